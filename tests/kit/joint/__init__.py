"""Every state of control that a vehicle can come into, found by trying everything from each."""
