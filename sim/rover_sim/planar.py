"""A body on level ground without a physics engine: the common part of all frames.

It has no mass and no tyres, and is always level; tests of effects that depend on those use
``bullet``.
"""

import math

from rover_sim.body import BodyState, Pose, wrap_angle

MAX_ACCELERATION = 6.0  # m/s², the limit of tyres on dry ground
SNAP = 1e-3  # m/s, rad/s; a smaller difference counts as reached
LAG_SPREAD = 0.8, 1.2  # factors on the lag; a seed draws between them
LONGEST_STEP = 0.05  # s; a longer advance is cut into equal parts


class PlanarBody:
    """Position and motion of a body; implements ``Body`` without ``drive``.

    ``lag`` in s, from demand to motion.
    """

    def __init__(self, *, start: Pose, lag: float) -> None:
        self.lag = lag
        self._time = 0.0
        self._north, self._east, self._yaw = start.north, start.east, wrap_angle(start.yaw)
        self._speed = self._yaw_rate = 0.0
        self._demanded_speed = 0.0

    def __repr__(self) -> str:
        place = f"{self._north:.2f} N, {self._east:.2f} E"
        return f"{type(self).__name__}({place}, {self._speed:.2f} m/s)"

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance``."""
        return BodyState(
            time=self._time,
            north=self._north,
            east=self._east,
            down=0.0,
            yaw=self._yaw,
            pitch=0.0,
            roll=0.0,
            forward_speed=self._speed,
            lateral_speed=0.0,
            yaw_rate=self._yaw_rate,
        )

    def advance(self, duration: float) -> None:
        """Move by ``duration`` seconds."""
        parts = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        for _ in range(parts):
            self._step(duration / parts)

    def close(self) -> None:
        """Do nothing: the body holds no resources."""

    def _next_yaw_rate(self, speed: float, dt: float) -> float:
        """Return the yaw rate after ``dt`` seconds, for a rover that then drives at ``speed``."""
        raise NotImplementedError

    def _step(self, dt: float) -> None:
        speed = approach(self._speed, self._demanded_speed, self.lag, MAX_ACCELERATION, dt)
        yaw_rate = self._next_yaw_rate(speed, dt)
        # Mean speed of both ends, along the heading in the middle: second order on arcs.
        distance = 0.5 * (self._speed + speed) * dt
        turned = 0.5 * (self._yaw_rate + yaw_rate) * dt
        heading = self._yaw + 0.5 * turned
        self._north += distance * math.cos(heading)
        self._east += distance * math.sin(heading)
        self._yaw = wrap_angle(self._yaw + turned)
        self._speed, self._yaw_rate = speed, yaw_rate
        self._time += dt


def approach(value: float, target: float, lag: float, limit: float, dt: float) -> float:
    """Return the value after one step of a rate-limited lag; it reaches the target exactly."""
    error = target - value
    if abs(error) < SNAP:
        return target
    change = error * (1.0 - math.exp(-dt / lag))
    return value + max(-limit * dt, min(limit * dt, change))
