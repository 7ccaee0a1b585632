"""Real rovers and the simulated one, compared: the same manoeuvres, the same figures.

``manoeuvres`` drives the simulated rover over MAVLink in virtual time and records a ``Trace``;
``figures`` computes numbers from a trace; ``reference`` has the numbers of two real autopilots;
``verdict`` compares both; ``explained`` has the intended differences.
"""
