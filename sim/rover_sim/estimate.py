"""The autopilot's estimate: the truth, changed by faults."""

import math
from typing import NamedTuple

from rover_sim.body import BodyState, turned, wrap_angle
from rover_sim.faults import Faults


class Estimate(NamedTuple):
    """Position and motion as the autopilot reports and uses them. SI, NED, from its origin."""

    north: float
    east: float
    down: float
    vn: float
    ve: float
    roll: float
    pitch: float
    yaw: float
    forward_speed: float
    yaw_rate: float

    @property
    def ground_speed(self) -> float:
        """Speed over ground, m/s, never negative."""
        return math.hypot(self.vn, self.ve)

    @property
    def without_numbers(self) -> "Estimate":
        """A failed estimator's output: every field is NaN."""
        return Estimate(*[math.nan] * len(self))


def estimate_from(truth: BodyState, faults: Faults, last: Estimate | None) -> Estimate:
    """Return the present estimate.

    With a frozen position, attitude, rates and wheel speed stay live: gyros and encoders work.
    """
    if faults.position_frozen and last is not None:
        north, east, down, vn, ve = last.north, last.east, last.down, last.vn, last.ve
    else:
        north = truth.north + faults.position_jump[0]
        east = truth.east + faults.position_jump[1]
        down = truth.down
        vn, ve = turned(truth.forward_speed, truth.lateral_speed, truth.yaw)
    yaw, yaw_rate = wrap_angle(truth.yaw + faults.heading_error), truth.yaw_rate
    if faults.heading_frozen and last is not None:
        yaw, yaw_rate = last.yaw, 0.0
    if faults.says_it_stands:
        vn = ve = yaw_rate = 0.0
    motion = (truth.forward_speed, yaw_rate)
    return Estimate(north, east, down, vn, ve, truth.roll, truth.pitch, yaw, *motion)
