"""Conformance checks: what the task server and its clients expect of a vehicle.

``python -m rover_sim.check_vehicle URL`` checks any vehicle that speaks MAVLink, simulated or real.
It uses only pymavlink and shares no code with the server or the simulated rover, so that a
misunderstanding of the protocol cannot cancel itself out.
"""
