"""The observing client of the trial, the demonstration and the check of rovers.

``observer`` listens and asks, ``track`` keeps poses and ``truth`` fills it with true ones,
``driver`` moves a rover by setpoints of its own, ``picture`` draws tracks.
"""
