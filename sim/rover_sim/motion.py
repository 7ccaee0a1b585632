"""The rate of all controllers, the yaw rate controller, and the lag of the wheels behind them."""

import math
from dataclasses import dataclass

from rover_sim.actuators import Motion
from rover_sim.frames import Frame

CONTROL_RATE = 40  # Hz. Divides the 240 Hz physics; 20 and 10 Hz telemetry is evenly spaced
CONTROL_PERIOD = 1.0 / CONTROL_RATE  # s
YAW_P = 0.8
YAW_I = 8.0  # 1/s; friction differs with heading, and a slow loop would show that
YAW_I_LIMIT = 2.0  # rad/s; a skid-steered rover loses a third of its yaw rate to scrubbing
#: s, of the recorded rovers' wheels; the lag of an Ackermann rover is in its drive train
LAGS = {Frame.SKID: 0.08, Frame.DIFFERENTIAL: 0.08, Frame.ACKERMANN: 0.0}
THERE = 1e-3  # m/s, rad/s; a smaller difference counts as zero


@dataclass(slots=True)
class YawControl:
    """Ramps a yaw rate and closes the loop on it, because scrubbing wheels lose part of it."""

    limit: float  # rad/s
    acceleration: float  # rad/s²
    deceleration: float  # rad/s²
    integral: float = YAW_I  # 1/s
    yaw_rate: float = 0.0  # rad/s, the ramped demand
    correction: float = 0.0  # rad/s

    def step(self, demanded: float, measured: float, *, rolls: bool) -> float:
        """Return the yaw rate for the wheels, for one control period."""
        wanted = clipped(demanded, self.limit)
        slows = abs(wanted) < abs(self.yaw_rate)
        change = self.deceleration if slows else self.acceleration
        rate = self.yaw_rate = toward(self.yaw_rate, wanted, change * CONTROL_PERIOD)
        if rate == 0.0 and (not rolls or abs(measured) < 1e-6):
            self.correction = 0.0
            return 0.0  # locked wheels stop exactly
        error = rate - measured
        integral = self.correction + self.integral * error * CONTROL_PERIOD
        self.correction = clipped(integral, YAW_I_LIMIT)
        return rate + YAW_P * error + self.correction


def clipped(value: float, limit: float) -> float:
    """Return the value within -limit..limit."""
    return max(-limit, min(limit, value))


def toward(value: float, goal: float, step: float) -> float:
    """Return the value, moved towards the goal by at most ``step``."""
    change = goal - value
    if abs(change) <= step:
        return goal
    return value + step if change > 0 else value - step


class Motors:
    """First-order lag, for a body that follows faster than the real rover's wheels."""

    def __init__(self, *, wanted: float, body: float) -> None:
        """Add the part of the ``wanted`` lag (s) that exceeds the lag of the ``body``."""
        missing = wanted - body
        self._part = 1.0 - math.exp(-CONTROL_PERIOD / missing) if missing > 0.0 else 1.0
        self._motion: Motion = (0.0, 0.0)

    def step(self, asked: Motion) -> Motion:
        """Return the motion of the wheels in this control period."""
        speed, yaw_rate = map(self._nearer, self._motion, asked)
        self._motion = (speed, yaw_rate)
        return self._motion

    def _nearer(self, value: float, goal: float) -> float:
        change = goal - value
        is_there = self._part == 1.0 or abs(change) < THERE
        return goal if is_there else value + change * self._part
