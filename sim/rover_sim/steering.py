"""From a target to a demand: pure functions, no state.

A skid-steered rover turns on the spot when a yaw rate is demanded; an Ackermann rover turns only
while it rolls, and drives arcs. Towards a heading ArduPilot steers any rover like a car, as
observed (no speed, no turn).
"""

import math
from dataclasses import dataclass
from enum import Enum

from rover_sim.body import wrap_angle
from rover_sim.estimate import Estimate
from rover_sim.motion import clipped
from rover_sim.setpoints import Destination

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


def way_to(estimate: Estimate, place: Destination) -> tuple[float, float]:
    """Return the distance to a place (m), and how far it is off the heading (rad)."""
    dn, de = place.north - estimate.north, place.east - estimate.east
    return math.hypot(dn, de), wrap_angle(math.atan2(de, dn) - estimate.yaw)


def steer_to_heading(estimate: Estimate, yaw: float, speed: float) -> Demand:
    """Return the demand to drive at ``speed`` while turning to ``yaw`` on an arc."""
    limit = min(MAX_YAW_RATE, abs(estimate.forward_speed) / TURN_RADIUS)
    return Demand(speed, clipped(HEADING_GAIN * wrap_angle(yaw - estimate.yaw), limit))


def steer_to_place(
    estimate: Estimate, place: Destination, speed_limit: float, radius: float, *, pivots: bool
) -> Demand | None:
    """Return the demand to drive to a place and slow down there; None within ``radius`` (m).

    A rover that ``pivots`` turns on the spot towards the place. Another one never stops on the way,
    because it could not turn then, and drives at half speed if the place is behind it.
    """
    distance, error = way_to(estimate, place)
    if distance < radius:
        return None
    yaw_rate = clipped(2.0 * HEADING_GAIN * error, MAX_YAW_RATE)
    approach = min(math.sqrt(2.0 * 0.6 * BRAKING * distance), APPROACH_GAIN * distance)
    if not pivots:
        speed = min(speed_limit, max(approach, LEAST_ARC_SPEED))
        return Demand(speed * (1.0 - 0.5 * abs(error) / math.pi), yaw_rate)
    if abs(error) > PIVOT_ERROR:
        return Demand(0.0, yaw_rate)
    return Demand(min(speed_limit, approach) * math.cos(error), yaw_rate)
