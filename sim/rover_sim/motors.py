"""The lag of the wheels behind the drive train."""

import math

from rover_sim.actuators import Motion
from rover_sim.frames import Frame
from rover_sim.motion import CONTROL_PERIOD

#: s, of the recorded rovers; the lag of an Ackermann rover is in its drive train
LAGS = {Frame.SKID: 0.08, Frame.DIFFERENTIAL: 0.08, Frame.ACKERMANN: 0.0}
THERE = 1e-3  # m/s, rad/s; a smaller difference counts as zero


class Motors:
    """First-order lag, for a body that follows faster than the real rover's wheels."""

    def __init__(self, *, wanted: float, body: float) -> None:
        """Add the part of the ``wanted`` lag (s) that exceeds the lag of the ``body``."""
        missing = wanted - body
        self._part = 1.0 - math.exp(-CONTROL_PERIOD / missing) if missing > 0.0 else 1.0
        self._motion: Motion = (0.0, 0.0)

    def step(self, asked: Motion) -> Motion:
        """Return the motion of the wheels in this control period."""
        self._motion = (
            _nearer(self._motion[0], asked[0], self._part),
            _nearer(self._motion[1], asked[1], self._part),
        )
        return self._motion


def _nearer(value: float, goal: float, part: float) -> float:
    change = goal - value
    return goal if part == 1.0 or abs(change) < THERE else value + change * part
