"""Real rovers beside the simulated one: the same manoeuvres, the same figures, side by side.

``manoeuvres`` drives the simulated rover over MAVLink in virtual time and records a ``Trace``;
``figures`` computes numbers from a trace; ``reference`` holds the numbers that two real autopilots
gave; ``verdict`` compares, with ``explained`` for what differs on purpose.
"""
