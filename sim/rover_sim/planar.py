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
STANDING = (0.0,) * 5  # pitch, roll, and motion


class PlanarBody:
    """Position and motion of a body; implements ``Body`` without ``drive``.

    ``lag`` in s, from demand to motion.
    """

    def __init__(self, *, start: Pose, lag: float) -> None:
        self.lag = lag
        #: the state after the last ``advance``
        self.state = BodyState(0.0, start.north, start.east, 0.0, wrap_angle(start.yaw), *STANDING)
        self._demanded_speed = 0.0

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.state})"

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
        s, demanded = self.state, self._demanded_speed
        speed = approach(s.forward_speed, demanded, self.lag, MAX_ACCELERATION, dt)
        yaw_rate = self._next_yaw_rate(speed, dt)
        # Mean speed of both ends, along the heading in the middle: second order on arcs.
        distance = 0.5 * (s.forward_speed + speed) * dt
        turned = 0.5 * (s.yaw_rate + yaw_rate) * dt
        heading = s.yaw + 0.5 * turned
        self.state = s._replace(
            time=s.time + dt,
            north=s.north + distance * math.cos(heading),
            east=s.east + distance * math.sin(heading),
            yaw=wrap_angle(s.yaw + turned),
            forward_speed=speed,
            yaw_rate=yaw_rate,
        )


def approach(value: float, target: float, lag: float, limit: float, dt: float) -> float:
    """Return the value after one step of a rate-limited lag; it reaches the target exactly."""
    error = target - value
    if abs(error) < SNAP:
        return target
    change = error * (1.0 - math.exp(-dt / lag))
    return value + max(-limit * dt, min(limit * dt, change))
