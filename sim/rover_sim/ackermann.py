"""A body with two steered front wheels, without a physics engine; implements ``Body``.

It cannot turn on the spot: a turn rate at no speed turns its wheels, if that, and moves nothing.
"""

import math
from random import Random

from rover_sim.body import Pose
from rover_sim.frames import SERVO_RATE, TURN_RADIUS, WHEEL_BASE
from rover_sim.planar import LAG_SPREAD, PlanarBody

MAX_STEERING = math.atan(WHEEL_BASE / TURN_RADIUS)  # rad, 24 degrees
LAG = 0.02  # s, from the wheels to the body: what is slow is in the drive train
ROLLING = 0.005  # m/s of demanded speed, below which nothing says where to steer


class AckermannBody(PlanarBody):
    """Moves along the arc that its front wheels point to, a little late.

    ``seed`` varies the lag and how far the steering is off centre between rovers; None: neither.
    """

    def __init__(self, *, start: Pose, seed: int | None) -> None:
        variation = Random(seed) if seed is not None else None
        lag = LAG * variation.uniform(*LAG_SPREAD) if variation else LAG
        super().__init__(start=start, lag=lag)
        # rad; a linkage that is off by half a degree bends 10 m of way by 1 m
        self._off_centre = math.radians(variation.uniform(-0.3, 0.3)) if variation else 0.0
        self._steering = self._demanded_steering = 0.0

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion; kept until the next call. At no speed the wheels stay as they are."""
        self._demanded_speed = forward_speed
        self._demanded_steering = steering_for(forward_speed, yaw_rate, self._demanded_steering)

    def _next_yaw_rate(self, speed: float, dt: float) -> float:
        change, most = self._demanded_steering - self._steering, SERVO_RATE * dt
        self._steering += max(-most, min(most, change))
        return speed * math.tan(self._steering + self._off_centre) / WHEEL_BASE


def steering_for(forward_speed: float, yaw_rate: float, present: float) -> float:
    """Return the front wheels' angle (rad, right is positive) that makes this motion, or nearest.

    ``present``: the angle that is kept where there is no speed to tell one by.
    """
    if abs(forward_speed) < ROLLING:
        return present
    angle = math.atan(WHEEL_BASE * yaw_rate / forward_speed)
    return max(-MAX_STEERING, min(MAX_STEERING, angle))
