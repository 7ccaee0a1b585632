"""Does a rover behave as the real autopilots do? For developers, and not in the wheel.

``contract`` lists what the server and its clients rely on beyond what ``mav-tasks probe`` tells,
and asks any rover for it. ``manoeuvres`` drives a simulated rover through what two real autopilots
were recorded in, ``figures`` measures it beside the real ones (real.csv). ``simulated`` makes the
rovers, in virtual time.
"""
