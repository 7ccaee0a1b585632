"""How a PX4 1.17 rover computes yaw rate and speed from a course or a place.

Towards a course it turns while it drives, whatever the angle. Towards a place a differential rover
turns on the spot first; an Ackermann rover drives an arc at a reduced speed.
"""

import math

from rover_sim.body import wrap_angle
from rover_sim.frames import TURN_RADIUS
from rover_sim.motion import clipped
from rover_sim.onboard import Onboard
from rover_sim.setpoints import Destination
from rover_sim.steering import Demand, way_to


class Px4Guidance:
    """Steers by RO_* and RD_*; its only state is whether it turns on the spot."""

    def __init__(self, on: Onboard) -> None:
        self._on = on
        self._pivots = on.persona.frame.turns_on_the_spot
        self._turns = False

    def to_course(self, yaw: float, speed: float) -> Demand:
        """Return the demand to drive at ``speed`` and turn to ``yaw``, even at zero speed."""
        rate = self._yaw_rate(wrap_angle(yaw - self._on.estimate.yaw))
        return Demand(clipped(speed, self._on.speed_limit), rate)

    def to_place(self, place: Destination, speed_limit: float, *, radius: float) -> Demand | None:
        """Return the demand to drive to a place and slow down there; None within ``radius``."""
        values = self._on.parameters
        distance, error = way_to(self._on.estimate, place)
        if distance < radius:
            self._turns = False
            return None
        rate = self._yaw_rate(error)
        if self._pivots:
            limit = "RD_TRANS_TRN_DRV" if self._turns else "RD_TRANS_DRV_TRN"
            self._turns = abs(error) > values[limit]
            if self._turns:
                return Demand(0.0, rate)
        left = speed_left(distance, values["RO_DECEL_LIM"], values["RO_JERK_LIM"])
        turning = 1.0 - min(1.0, values["RO_SPEED_RED"] * abs(error) / math.pi)
        # m/s, at which full lock gives RO_YAW_RATE_LIM
        least = 0.0 if self._pivots else TURN_RADIUS * math.radians(values["RO_YAW_RATE_LIM"])
        most = max(least, values["RO_MAX_THR_SPEED"] * turning)
        return Demand(min(speed_limit, left, most), rate)

    def _yaw_rate(self, error: float) -> float:
        values = self._on.parameters
        most = math.radians(values["RO_YAW_RATE_LIM"])
        if not self._pivots:
            most = min(most, abs(self._on.estimate.forward_speed) / TURN_RADIUS)
        return clipped(values["RO_YAW_P"] * error, most)


def speed_left(distance: float, deceleration: float, jerk: float) -> float:
    """Return the speed from which the rover can stop within ``distance`` metres.

    Braking starts with limited jerk (m/s³) and is then constant (m/s²): the distance is v² / 2a + 2
    v a / j, solved for v.
    """
    b = 4.0 * deceleration * deceleration / jerk
    return 0.5 * (math.sqrt(b * b + 8.0 * deceleration * distance) - b)
