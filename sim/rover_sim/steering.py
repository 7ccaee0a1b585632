"""From a target to a demand: pure functions, no state.

A skid-steered rover turns on the spot when a yaw rate is demanded; an Ackermann rover turns only
while it rolls, and drives arcs. Towards a heading ArduPilot steers any rover like a car, as
observed (no speed, no turn).
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
BRAKING = 0.9  # m/s², planned towards a point
PIVOT_ERROR = math.radians(60)  # above it a rover turns on the spot towards a waypoint
APPROACH_GAIN = 1.0  # 1/s, speed per remaining metre, over the last metre
LEAST_ARC_SPEED = 0.3  # m/s


class Output(Enum):
    """State of the motor outputs."""

    CONTROLLED = "controlled"  # the controllers set speed and yaw rate
    NEUTRAL = "neutral"  # throttle and steering neutral; ArduPilot's HOLD
    OFF = "off"  # disarmed


@dataclass(frozen=True, slots=True)
class Demand:
    """The demanded motion, before acceleration limits."""

    speed: float  # m/s, negative is backwards
    yaw_rate: float  # rad/s, clockwise
    output: Output = Output.CONTROLLED


STOP = Demand(0.0, 0.0)
HOLD = Demand(0.0, 0.0, Output.NEUTRAL)
COAST = Demand(0.0, 0.0, Output.OFF)


class SteerToPoint(Protocol):
    """A way to drive to a point."""

    def __call__(
        self, estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
    ) -> Demand | None:
        """Return the demand; None within ``radius`` (m)."""
        ...


def steer_to_heading(estimate: Estimate, yaw: float, speed: float) -> Demand:
    """Return the demand to drive at ``speed`` while turning to ``yaw`` on an arc."""
    limit = min(MAX_YAW_RATE, abs(estimate.forward_speed) / TURN_RADIUS)
    wanted = HEADING_GAIN * wrap_angle(yaw - estimate.yaw)
    return Demand(speed, max(-limit, min(limit, wanted)))


def steer_to_point(
    estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
) -> Demand | None:
    """Return the demand to drive to a point and slow down there; None within ``radius``."""
    dn, de = north - estimate.north, east - estimate.east
    distance = math.hypot(dn, de)
    if distance < radius:
        return None
    error = wrap_angle(math.atan2(de, dn) - estimate.yaw)
    yaw_rate = _turn(error)
    if abs(error) > PIVOT_ERROR:
        return Demand(0.0, yaw_rate)
    return Demand(min(speed_limit, _approach(distance)) * math.cos(error), yaw_rate)


def arc_to_point(
    estimate: Estimate, north: float, east: float, speed_limit: float, *, radius: float
) -> Demand | None:
    """Return the demand to drive to a point on arcs, for a rover that cannot turn on the spot.

    None within ``radius``. The rover never stops on the way, because it could not turn then. It
    drives at half speed if the point is behind it.
    """
    dn, de = north - estimate.north, east - estimate.east
    distance = math.hypot(dn, de)
    if distance < radius:
        return None
    error = wrap_angle(math.atan2(de, dn) - estimate.yaw)
    yaw_rate = _turn(error)
    speed = min(speed_limit, max(_approach(distance), LEAST_ARC_SPEED))
    return Demand(speed * (1.0 - 0.5 * abs(error) / math.pi), yaw_rate)


def _turn(error: float) -> float:
    """Return the yaw rate, rad/s, that turns by a heading error."""
    return max(-MAX_YAW_RATE, min(MAX_YAW_RATE, 2.0 * HEADING_GAIN * error))


def _approach(distance: float) -> float:
    """Return the highest speed, m/s, from which the rover stops within a distance."""
    return min(math.sqrt(2.0 * 0.6 * BRAKING * distance), APPROACH_GAIN * distance)
