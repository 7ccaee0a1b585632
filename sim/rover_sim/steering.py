"""From where to go to how to move: pure functions, no state.

A skid-steered rover turns on the spot when it is asked for a turn rate; an Ackermann rover only
turns while it rolls, and takes arcs. Towards a heading ArduPilot steers any rover as a car, as the
real one was seen to (no speed, no turn).
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from rover_sim.body import wrap_angle
from rover_sim.estimate import Estimate

MAX_YAW_RATE = 1.6  # rad/s
HEADING_GAIN = 1.2  # 1/s, yaw rate per heading error
TURN_RADIUS = 1.5  # m, tightest arc while steering to a heading
BRAKING = 0.9  # m/s²; 2 m/s to a stand in 2.2 s and 2.2 m
HOLD_BRAKING = 0.75  # m/s²; in HOLD it takes 3 s from 2.1 m/s
COASTING = 0.5  # m/s², disarmed: rolling resistance and geared motors
PIVOT_ERROR = math.radians(60)  # beyond it a rover turns on the spot towards a waypoint
APPROACH_GAIN = 1.0  # 1/s, speed per metre left, over the last metre
LEAST_ARC_SPEED = 0.3  # m/s


class Output(Enum):
    """What the motor outputs do."""

    CONTROLLED = "controlled"  # the controllers see to speed and turn rate
    NEUTRAL = "neutral"  # throttle and steering in the middle; ArduPilot's HOLD
    OFF = "off"  # disarmed


@dataclass(frozen=True, slots=True)
class Demand:
    """What the rover shall do now, before acceleration limits."""

    speed: float  # m/s, negative is backwards
    yaw_rate: float  # rad/s, clockwise
    braking: float = BRAKING  # m/s², how fast speed may fall, where the drive is exact
    output: Output = Output.CONTROLLED


STOP = Demand(0.0, 0.0)
HOLD = Demand(0.0, 0.0, HOLD_BRAKING, Output.NEUTRAL)
COAST = Demand(0.0, 0.0, COASTING, Output.OFF)


class SteerToPoint(Protocol):
    """A way to drive to a point."""

    def __call__(
        self, estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
    ) -> Demand | None:
        """Say how to move now; None once within ``radius`` (m)."""
        ...


def steer_to_heading(estimate: Estimate, yaw: float, speed: float) -> Demand:
    """Drive at ``speed`` while turning to ``yaw`` on an arc."""
    limit = min(MAX_YAW_RATE, abs(estimate.forward_speed) / TURN_RADIUS)
    wanted = HEADING_GAIN * wrap_angle(yaw - estimate.yaw)
    return Demand(speed, max(-limit, min(limit, wanted)))


def turn_then_drive(estimate: Estimate, yaw: float, speed: float) -> Demand:
    """Drive at ``speed`` towards ``yaw``; turn to it on the spot first, if it is far off."""
    error = wrap_angle(yaw - estimate.yaw)
    if speed == 0.0:
        return STOP
    yaw_rate = max(-MAX_YAW_RATE, min(MAX_YAW_RATE, 2.0 * HEADING_GAIN * error))
    return Demand(0.0 if abs(error) > PIVOT_ERROR else speed * math.cos(error), yaw_rate)


def steer_to_point(
    estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
) -> Demand | None:
    """Drive to a point and be slow there; None once within ``radius``."""
    dn, de = north - estimate.north, east - estimate.east
    distance = math.hypot(dn, de)
    if distance < radius:
        return None
    error = wrap_angle(math.atan2(de, dn) - estimate.yaw)
    yaw_rate = max(-MAX_YAW_RATE, min(MAX_YAW_RATE, 2.0 * HEADING_GAIN * error))
    if abs(error) > PIVOT_ERROR:
        return Demand(0.0, yaw_rate)
    slowest_stop = min(math.sqrt(2.0 * 0.6 * BRAKING * distance), APPROACH_GAIN * distance)
    return Demand(min(speed_limit, slowest_stop) * math.cos(error), yaw_rate)


def arc_to_point(
    estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
) -> Demand | None:
    """Drive to a point on arcs, as a rover must that cannot turn on the spot; None once there.

    It never stands on the way: it would no longer be able to turn. Half its speed is left to a
    point behind it.
    """
    dn, de = north - estimate.north, east - estimate.east
    distance = math.hypot(dn, de)
    if distance < radius:
        return None
    error = wrap_angle(math.atan2(de, dn) - estimate.yaw)
    yaw_rate = max(-MAX_YAW_RATE, min(MAX_YAW_RATE, 2.0 * HEADING_GAIN * error))
    slowest_stop = min(math.sqrt(2.0 * 0.6 * BRAKING * distance), APPROACH_GAIN * distance)
    speed = min(speed_limit, max(slowest_stop, LEAST_ARC_SPEED))
    return Demand(speed * (1.0 - 0.5 * abs(error) / math.pi), yaw_rate)
