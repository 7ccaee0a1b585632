"""Every reachable state of a vehicle's control, found by trying every event in each."""
