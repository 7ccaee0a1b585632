"""How a PX4 1.17 rover computes yaw rate and speed from a course or a place.

Towards a course it turns while it drives, whatever the angle. Towards a place a differential rover
turns on the spot first; an Ackermann rover drives an arc at a reduced speed.
"""

import math

from rover_sim.body import wrap_angle
from rover_sim.estimate import Estimate
from rover_sim.frames import TURN_RADIUS, Frame
from rover_sim.parameters import Parameters
from rover_sim.px4_drive import speed_limit_of
from rover_sim.steering import Demand


class Px4Guidance:
    """Steers by RO_* and RD_*; its only state is whether it turns on the spot."""

    def __init__(self, frame: Frame, parameters: Parameters) -> None:
        self._frame = frame
        self._parameters = parameters
        self._turns = False

    def __repr__(self) -> str:
        return f"Px4Guidance({self._frame.value})"

    def to_course(self, estimate: Estimate, yaw: float, speed: float) -> Demand:
        """Return the demand to drive at ``speed`` and turn to ``yaw``, even at zero speed."""
        limit = speed_limit_of(self._parameters)
        rate = self._yaw_rate(estimate, wrap_angle(yaw - estimate.yaw))
        return Demand(max(-limit, min(limit, speed)), rate)

    def to_place(
        self, estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
    ) -> Demand | None:
        """Return the demand to drive to a place and slow down there; None within ``radius``."""
        dn, de = north - estimate.north, east - estimate.east
        distance = math.hypot(dn, de)
        if distance < radius:
            self._turns = False
            return None
        error = wrap_angle(math.atan2(de, dn) - estimate.yaw)
        rate = self._yaw_rate(estimate, error)
        if self._turns_on_the_spot(abs(error)):
            return Demand(0.0, rate)
        values = self._parameters
        left = speed_left(distance, values["RO_DECEL_LIM"], values["RO_JERK_LIM"])
        turning = 1.0 - min(1.0, values["RO_SPEED_RED"] * abs(error) / math.pi)
        least = 0.0 if self._frame.turns_on_the_spot else self._least_speed()
        most = max(least, values["RO_MAX_THR_SPEED"] * turning)
        return Demand(min(speed_limit, left, most), rate)

    def _turns_on_the_spot(self, error: float) -> bool:
        if not self._frame.turns_on_the_spot:
            return False
        limit = "RD_TRANS_TRN_DRV" if self._turns else "RD_TRANS_DRV_TRN"
        self._turns = error > self._parameters[limit]
        return self._turns

    def _least_speed(self) -> float:
        """Return the speed at which full lock gives RO_YAW_RATE_LIM, m/s."""
        return TURN_RADIUS * math.radians(self._parameters["RO_YAW_RATE_LIM"])

    def _yaw_rate(self, estimate: Estimate, error: float) -> float:
        most = math.radians(self._parameters["RO_YAW_RATE_LIM"])
        if not self._frame.turns_on_the_spot:
            most = min(most, abs(estimate.forward_speed) / TURN_RADIUS)
        return max(-most, min(most, self._parameters["RO_YAW_P"] * error))


def speed_left(distance: float, deceleration: float, jerk: float) -> float:
    """Return the speed from which the rover can stop within ``distance`` metres.

    Braking starts with limited jerk (m/s³) and is then constant (m/s²): the distance is v² / 2a + 2
    v a / j, solved for v.
    """
    b = 4.0 * deceleration * deceleration / jerk
    return 0.5 * (math.sqrt(b * b + 8.0 * deceleration * distance) - b)
