"""Guidance: (leg, where the vehicle is) → the velocity to command, or arrival. Stateless.

The loop is closed on the measured pose. Nothing is integrated, so that a lost setpoint, a pause or
a pre-emption leaves no error behind. ``limits`` bounds the velocity before it is sent.
"""

from dataclasses import dataclass
from math import atan, atan2, copysign, cos, hypot, pi, radians, sin, sqrt, tan
from typing import NamedTuple

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.path import Follow, forward_of, nearest
from mav_tasks.tasks.goal import Drive, Head, Move, Rotate, Wait
from mav_tasks.tasks.task import Pose

#: the goals that can be steered; ``legs`` splits every goal into these
Leg = Move | Rotate | Drive | Head | Wait | Follow

APPROACH_GAIN = 1.2  # 1/s, in the last centimetres: speed = gain * remaining
#: m/s, the least setpoint; half of it moved no ArduPilot reliably (its PWM is then 1500)
CREEP_SPEED = 0.05
TURN_GAIN = 1.6  # 1/s, the same for turning
CREEP_RATE = 0.03  # rad/s
HEADING_GAIN = 1.5  # 1/s, heading error -> turn rate while moving
CROSS_TRACK_GAIN = 1.2  # 1/m, sideways error -> approach angle
MAX_APPROACH_ANGLE = pi / 6  # rad, towards the line
MAX_STEER_RATE = 0.5  # rad/s, of corrections while moving
AHEAD = 0.5  # s by which the course leads the heading if a vehicle turns to it by itself
LEAST_AHEAD = radians(10)  # rad, least lead
PIVOT_ERROR = pi / 4  # rad; with a larger heading error it turns on the spot before it drives
#: m/s, limit at such an error for a car, and for a vehicle that is steered by course: it may turn
#: on the spot by itself, or in an arc
BOW_SPEED = 0.2
#: factor on a car's known curvature that may be commanded: with default gains ArduPilot's steering
#: reaches half of it (4.6.3, SITL)
MORE_CURVATURE = 2.0


@dataclass(frozen=True, slots=True)
class Motion:
    """A vehicle's measured pose and velocity, and when (monotonic seconds).

    ``forward`` and ``sideways`` in m/s along and across the body, ``yaw_rate`` in rad/s. ``at`` is
    the older of the times of position and attitude.
    """

    pose: Pose
    forward: float
    sideways: float
    yaw_rate: float
    at: float

    @property
    def speed(self) -> float:
        """Speed over ground, m/s."""
        return hypot(self.forward, self.sideways)


@dataclass(frozen=True, slots=True)
class Velocity:
    """A setpoint in the body frame: m/s forward, rad/s clockwise.

    ``course`` is the direction to drive in, rad from north, for a vehicle that is steered by
    course; the yaw rate is 0 then, and ``forward`` not negative.
    """

    forward: float
    yaw_rate: float
    course: float | None = None

    @property
    def is_zero(self) -> bool:
        """Whether this asks for standstill; a course alone asks for a turn to it."""
        return self.forward == 0.0 and self.yaw_rate == 0.0 and self.course is None


ZERO = Velocity(0.0, 0.0)


class Slowest(NamedTuple):
    """One rover's values for the end of a leg, as ``arrival`` has learnt them."""

    speed: float = CREEP_SPEED  # m/s, the least that moves it
    rate: float = CREEP_RATE  # rad/s, the same for turning
    gain: float = APPROACH_GAIN  # 1/s, speed per metre left
    turn_gain: float = TURN_GAIN  # 1/s, the same for turning


USUAL = Slowest()


def wrap(angle: float) -> float:
    """Return an angle wrapped to ±pi."""
    return atan2(sin(angle), cos(angle))


def done_so_far(
    leg: Leg, anchor: Pose, pose: Pose, *, before: float, elapsed: float = 0.0
) -> float:
    """Return the metres along the line, the radians turned, or the seconds, since the anchor.

    ``before`` is the last such value, and ``elapsed`` the time since. A rotation counts full turns:
    the result is the one nearest to ``before`` that fits the measured heading. This holds if the
    vehicle is seen at least twice in half a turn. The result is negative if the vehicle is behind
    its anchor.
    """
    match leg:
        case Move(distance=distance):
            return copysign(1.0, distance) * forward_of(anchor, pose)
        case Rotate(angle=angle):
            turned = copysign(1.0, angle) * (pose.yaw - anchor.yaw)
            return before + wrap(turned - before)
        case Follow(path=path):
            return nearest(anchor, path, pose, around=before)
        case Drive() | Head() | Wait():
            return before + elapsed


def cross_track(anchor: Pose, pose: Pose) -> float:
    """Return the metres to the right of the line from the anchor along its yaw."""
    return (pose.east - anchor.east) * cos(anchor.yaw) - (pose.north - anchor.north) * sin(
        anchor.yaw
    )


def has_arrived(leg: Leg, remaining: float, *, within: float, driving: Driving) -> bool:
    """Return whether ``remaining`` is within tolerance; ``within`` is a factor on the tolerance."""
    match leg:
        case Move() | Follow():
            return abs(remaining) <= within * driving.arrival_distance
        case Rotate():
            return abs(remaining) <= within * driving.arrival_angle
        case Drive() | Head() | Wait():
            return remaining <= 0.0


def is_settled(leg: Leg, remaining: float, *, driving: Driving) -> bool:
    """Return whether the end is near enough for a rover that can come no nearer."""
    match leg:
        case Move() | Follow():
            return abs(remaining) <= max(driving.settle_distance, driving.arrival_distance)
        case Rotate():
            return abs(remaining) <= max(driving.settle_angle, driving.arrival_angle)
        case Drive() | Head() | Wait():
            return remaining <= 0.0


def steer(
    leg: Leg,
    anchor: Pose,
    pose: Pose,
    *,
    remaining: float,
    driving: Driving,
    passing: float = 0.0,
    by_course: bool = False,
    radius: float | None = None,
    slowest: Slowest = USUAL,
) -> Velocity:
    """Return the velocity towards the leg's end; ``follow.steer_along`` does so for a path.

    ``remaining`` is negative beyond the end; the vehicle then drives back slowly. ``passing`` is
    the speed of a move at its end, m/s, if another follows. ``by_course``: the vehicle is steered
    by course and does not reverse. ``radius`` is the minimum turning radius of a car, m.
    """
    match leg:
        case Move(distance=distance, speed=speed):
            towards_end = approach(
                remaining,
                top=speed or driving.speed,
                braking=driving.acceleration,
                gain=slowest.gain,
                creep=slowest.speed,
                at_end=passing,
            )
            forward = copysign(towards_end, distance * remaining)
            error = _heading_error(anchor, pose, forward=forward)
            return _towards(error, forward, pose=pose, by_course=by_course, radius=radius)
        case Rotate(angle=angle, rate=rate):
            towards_end = approach(
                remaining,
                top=rate or driving.turn_rate,
                braking=driving.turn_acceleration,
                gain=slowest.turn_gain,
                creep=slowest.rate,
            )
            turn = copysign(towards_end, angle * remaining)
            if by_course:  # it turns by itself at its full rate: keep the lead small
                ahead = max(LEAST_AHEAD, AHEAD * abs(turn))
                lead = copysign(min(abs(remaining), ahead), turn)
                return Velocity(0.0, 0.0, wrap(pose.yaw + lead))
            return Velocity(0.0, turn)
        case Drive(forward=forward, yaw_rate=yaw_rate):
            return Velocity(forward, yaw_rate, anchor.yaw if by_course else None)
        case Head(yaw=yaw, forward=forward):
            error = wrap(yaw - pose.yaw)
            return _towards(error, forward, pose=pose, by_course=by_course, radius=radius)
        case Wait() | Follow():
            return ZERO


def _towards(
    heading_error: float, forward: float, *, pose: Pose, by_course: bool, radius: float | None
) -> Velocity:
    """Return a velocity that drives if the heading is about right, and first turns otherwise.

    A car, or a vehicle steered by course, drives slowly meanwhile instead of turning on the spot.
    """
    if by_course:
        slow = min(forward, BOW_SPEED) if is_far_off(heading_error) else forward
        return Velocity(max(slow, 0.0), 0.0, wrap(pose.yaw + heading_error))
    rate = max(-MAX_STEER_RATE, min(MAX_STEER_RATE, HEADING_GAIN * heading_error))
    if radius is not None:
        slow = min(abs(forward), BOW_SPEED) if is_far_off(heading_error) else abs(forward)
        most = MORE_CURVATURE * slow / radius
        return Velocity(copysign(slow, forward), max(-most, min(most, rate)))
    return Velocity(0.0 if is_far_off(heading_error) else forward, rate)


def is_far_off(heading_error: float) -> bool:
    """Return whether a vehicle has to turn before it can drive on."""
    return abs(heading_error) > PIVOT_ERROR


def corner_speed(turn: float, *, lead: float) -> float:
    """Return the speed in m/s for a corner of ``turn`` rad that is cut ``lead`` m before.

    Return 0 if the vehicle has to stop and turn on the spot.
    """
    bend = abs(turn)
    if bend > PIVOT_ERROR:
        return 0.0
    return MAX_STEER_RATE * lead / max(tan(bend / 2), 1e-3)


def approach(
    remaining: float,
    *,
    top: float,
    braking: float,
    gain: float,
    creep: float,
    at_end: float = 0.0,
) -> float:
    """Return the speed at a distance: the highest that allows braking, then ``gain`` * distance."""
    left = abs(remaining)
    braked = sqrt(at_end * at_end + 2 * 0.5 * braking * left)
    return max(min(creep, top), min(top, max(gain * left, at_end), braked))


def _heading_error(anchor: Pose, pose: Pose, *, forward: float) -> float:
    """Return the angle to turn by to get back to the line; smaller at low speed."""
    ahead = copysign(1.0, forward)
    speed_share = min(1.0, abs(forward) / 0.2)  # below 0.2 m/s only the heading counts
    approach = atan(CROSS_TRACK_GAIN * cross_track(anchor, pose)) * speed_share
    approach = max(-MAX_APPROACH_ANGLE, min(MAX_APPROACH_ANGLE, approach))
    return wrap(anchor.yaw - ahead * approach - pose.yaw)
