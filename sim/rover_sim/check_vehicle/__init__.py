"""An executable contract: what the task server, and its clients, expect of a vehicle.

``python -m rover_sim.check_vehicle URL``. It can be pointed at any vehicle that speaks MAVLink,
simulated or real. It speaks by pymavlink alone and shares no code with the server or the simulated
rover, so that a misunderstanding cannot cancel itself out.
"""
