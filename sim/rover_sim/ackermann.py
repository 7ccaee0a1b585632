"""A body with two steered front wheels, without a physics engine; implements ``Body``.

It cannot turn on the spot: a turn rate at no speed turns its wheels, if that, and moves nothing.
"""

import math
from random import Random

from rover_sim.body import BodyState, Pose, wrap_angle
from rover_sim.frames import SERVO_RATE, TURN_RADIUS, WHEEL_BASE
from rover_sim.kinematic import LONGEST_STEP, MAX_ACCELERATION, approach

MAX_STEERING = math.atan(WHEEL_BASE / TURN_RADIUS)  # rad, 24 degrees
LAG = 0.02  # s, from the wheels to the body: what is slow is in the drive train
ROLLING = 0.005  # m/s of demanded speed, below which nothing says where to steer


class AckermannBody:
    """Moves along the arc that its front wheels point to, a little late.

    ``seed`` varies the lag and how far the steering is off centre between rovers; None: neither.
    """

    def __init__(self, *, start: Pose, seed: int | None) -> None:
        variation = Random(seed) if seed is not None else None
        self.lag = LAG * variation.uniform(0.8, 1.2) if variation else LAG
        # rad; a linkage that is off by half a degree bends 10 m of way by 1 m
        self._off_centre = math.radians(variation.uniform(-0.3, 0.3)) if variation else 0.0
        self._time = 0.0
        self._north, self._east, self._yaw = start.north, start.east, wrap_angle(start.yaw)
        self._speed = self._steering = 0.0
        self._demanded_speed = self._demanded_steering = 0.0

    def __repr__(self) -> str:
        return f"AckermannBody({self._north:.2f} N, {self._east:.2f} E, {self._speed:.2f} m/s)"

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
        """Demand a motion; kept until the next call. At no speed the wheels stay as they are."""
        self._demanded_speed = forward_speed
        self._demanded_steering = steering_for(forward_speed, yaw_rate, self._demanded_steering)

    def advance(self, duration: float) -> None:
        """Move on by ``duration`` seconds."""
        parts = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        for _ in range(parts):
            self._step(duration / parts)

    def close(self) -> None:
        """Nothing is held."""

    @property
    def _yaw_rate(self) -> float:
        return self._speed * math.tan(self._steering + self._off_centre) / WHEEL_BASE

    def _step(self, dt: float) -> None:
        before, speed_before = self._yaw_rate, self._speed
        self._speed = approach(self._speed, self._demanded_speed, self.lag, MAX_ACCELERATION, dt)
        change, most = self._demanded_steering - self._steering, SERVO_RATE * dt
        self._steering += max(-most, min(most, change))
        # The mean of both ends, along the heading in the middle: second order on arcs.
        distance = 0.5 * (speed_before + self._speed) * dt
        turned = 0.5 * (before + self._yaw_rate) * dt
        heading = self._yaw + 0.5 * turned
        self._north += distance * math.cos(heading)
        self._east += distance * math.sin(heading)
        self._yaw = wrap_angle(self._yaw + turned)
        self._time += dt


def steering_for(forward_speed: float, yaw_rate: float, present: float) -> float:
    """Return the front wheels' angle (rad, right is positive) that makes this motion, or nearest.

    ``present``: the angle that is kept where there is no speed to tell one by.
    """
    if abs(forward_speed) < ROLLING:
        return present
    angle = math.atan(WHEEL_BASE * yaw_rate / forward_speed)
    return max(-MAX_STEERING, min(MAX_STEERING, angle))
