"""Do simulated rovers behave as the real autopilots do? For developers, and not in the wheel.

``manoeuvres`` drives a rover through what two real autopilots were recorded in, ``figures``
measures it beside the real ones (real.csv), ``simulated`` makes the rovers, in virtual time. What
any real rover does, ``mav-tasks probe`` and ``mav-tasks trial`` tell.
"""
