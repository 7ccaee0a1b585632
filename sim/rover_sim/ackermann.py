"""A body with two steered front wheels, without a physics engine; implements ``Body``.

It cannot turn on the spot: at zero speed a yaw rate turns its front wheels at most.
"""

import math

from rover_sim.body import Pose
from rover_sim.frames import SERVO_RATE, TURN_RADIUS, WHEEL_BASE
from rover_sim.motion import clipped
from rover_sim.planar import PlanarBody

MAX_STEERING = math.atan(WHEEL_BASE / TURN_RADIUS)  # rad, 24 degrees
LAG = 0.02  # s, body behind wheels; the drive train has the larger lags
ROLLING = 0.005  # m/s; below this demanded speed the steering angle is undefined


class AckermannBody(PlanarBody):
    """A body that follows the arc of its front wheels with a small lag.

    ``seed`` varies the lag and the steering offset between rovers; None varies neither.
    """

    def __init__(self, *, start: Pose, seed: int | None) -> None:
        super().__init__(start=start, lag=LAG, seed=seed)
        # rad; a linkage that is off by half a degree bends a path of 10 m by 1 m
        self._off_centre = math.radians(self._varied(0.3))
        self._steering = self._demanded_steering = 0.0

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion, kept until the next call. At zero speed the steering angle is kept."""
        self._demanded_speed = forward_speed
        self._demanded_steering = steering_for(forward_speed, yaw_rate, self._demanded_steering)

    def _next_yaw_rate(self, speed: float, dt: float) -> float:
        self._steering += clipped(self._demanded_steering - self._steering, SERVO_RATE * dt)
        return speed * math.tan(self._steering + self._off_centre) / WHEEL_BASE


def steering_for(forward_speed: float, yaw_rate: float, present: float) -> float:
    """Return the front wheels' angle for this motion, clipped to full lock (rad, right positive).

    ``present``: the angle to return if the speed is too low to define one.
    """
    if abs(forward_speed) < ROLLING:
        return present
    return clipped(math.atan(WHEEL_BASE * yaw_rate / forward_speed), MAX_STEERING)
