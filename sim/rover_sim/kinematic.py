"""A skid-steered body without a physics engine: lag, acceleration limits, slip.

For fast tests, and for interpreters that pybullet has no wheel for. It has no mass, no tyres and
always stands level: what depends on those is tested on ``bullet``.
"""

import math
from random import Random

from rover_sim.body import BodyState, Pose, wrap_angle

LAG = 0.08  # s, first-order lag from wheel-speed demand to motion
MAX_ACCELERATION = 6.0  # m/s², what tyres on dry ground can pass on
MAX_YAW_ACCELERATION = 12.0  # rad/s²
SNAP = 1e-3  # m/s, rad/s; nearer than this it is there
LONGEST_STEP = 0.05  # s; a longer advance is cut into equal parts
SLIP_SPREAD = 0.3  # of the slip; how far a seed can move it either way


class KinematicBody:
    """Moves as demanded, a little late; implements ``Body``.

    ``slip`` is the part of a demanded yaw rate that is lost in scrubbing tyres (0 none, 0.3 as
    the pybullet rover). ``seed`` varies slip and lag between rovers; None does not.
    """

    def __init__(self, *, start: Pose, slip: float, seed: int | None) -> None:
        if not 0.0 <= slip < 1.0:
            raise ValueError(f"slip must be in [0, 1), not {slip}")
        variation = Random(seed) if seed is not None else None
        self.lag = LAG * variation.uniform(0.8, 1.2) if variation else LAG
        spread = variation.uniform(-SLIP_SPREAD, SLIP_SPREAD) if variation else 0.0
        self._grip = 1.0 - min(slip * (1.0 + spread), 0.95)
        self._time = 0.0
        self._north, self._east, self._yaw = start.north, start.east, wrap_angle(start.yaw)
        self._speed = self._yaw_rate = 0.0
        self._demanded_speed = self._demanded_yaw_rate = 0.0

    def __repr__(self) -> str:
        return f"KinematicBody({self._north:.2f} N, {self._east:.2f} E, {self._speed:.2f} m/s)"

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

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion; kept until the next call."""
        self._demanded_speed = forward_speed
        self._demanded_yaw_rate = yaw_rate * self._grip

    def advance(self, duration: float) -> None:
        """Move on by ``duration`` seconds."""
        parts = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        for _ in range(parts):
            self._step(duration / parts)

    def close(self) -> None:
        """Nothing is held."""

    def _step(self, dt: float) -> None:
        speed = approach(self._speed, self._demanded_speed, self.lag, MAX_ACCELERATION, dt)
        yaw_rate = approach(
            self._yaw_rate, self._demanded_yaw_rate, self.lag, MAX_YAW_ACCELERATION, dt
        )
        # The mean of both ends, along the heading in the middle: second order on arcs.
        distance = 0.5 * (self._speed + speed) * dt
        turned = 0.5 * (self._yaw_rate + yaw_rate) * dt
        heading = self._yaw + 0.5 * turned
        self._north += distance * math.cos(heading)
        self._east += distance * math.sin(heading)
        self._yaw = wrap_angle(self._yaw + turned)
        self._speed, self._yaw_rate = speed, yaw_rate
        self._time += dt


def approach(value: float, target: float, lag: float, limit: float, dt: float) -> float:
    """One step of a rate-limited first-order lag; lands on the target, so that a stop is one."""
    error = target - value
    if abs(error) < SNAP:
        return target
    change = error * (1.0 - math.exp(-dt / lag))
    return value + max(-limit * dt, min(limit * dt, change))
