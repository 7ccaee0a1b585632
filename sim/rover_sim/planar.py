"""A body on level ground without a physics engine: the common part of all frames.

It has no mass and no tyres, and is always level; tests of effects that depend on those use
``bullet``.
"""

import math
from random import Random

from rover_sim.body import BodyState, Pose, wrap_angle
from rover_sim.motion import clipped

MAX_ACCELERATION = 6.0  # m/s², the limit of tyres on dry ground
SNAP = 1e-3  # m/s, rad/s; a smaller difference counts as reached
LAG_SPREAD = 0.2  # of the lag; a seed changes it by up to this, either way
LONGEST_STEP = 0.05  # s; a longer advance is cut into equal parts
STANDING = (0.0,) * 5  # pitch, roll, and motion


class PlanarBody:
    """Position and motion of a body; implements ``Body`` without ``drive``.

    ``lag`` in s, from demand to motion.
    """

    def __init__(self, *, start: Pose, lag: float, seed: int | None) -> None:
        """``seed`` varies the body between rovers; None varies nothing."""
        self._chance = None if seed is None else Random(seed)
        self.lag = lag * (1.0 + self._varied(LAG_SPREAD))
        #: the state after the last ``advance``
        self.state = BodyState(0.0, start.north, start.east, 0.0, wrap_angle(start.yaw), *STANDING)
        self._demanded_speed = 0.0

    def advance(self, duration: float) -> None:
        """Move by ``duration`` seconds."""
        parts = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        for _ in range(parts):
            self._step(duration / parts)

    def close(self) -> None:
        """Do nothing: the body holds no resources."""

    def _varied(self, most: float) -> float:
        return self._chance.uniform(-most, most) if self._chance else 0.0

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
    return value + clipped(change, limit * dt)
