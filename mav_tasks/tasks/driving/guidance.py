"""Guidance: (leg or path, where the vehicle is) → the velocity to command. Stateless.

The loop is closed on the measured pose. Nothing is integrated, so that a lost setpoint, a pause or
a pre-emption leaves no error behind. ``limits`` bounds the velocity before it is sent.
"""

from dataclasses import dataclass
from math import atan, atan2, copysign, hypot, inf, pi, radians, sqrt, tan
from typing import NamedTuple

from mav_tasks.kinds import Drive, Head, Move, Pose, Rotate, Wait
from mav_tasks.kinds.path import (
    Follow,
    cross_track,
    curvature_at,
    direction_of,
    path_length,
    pose_on,
    wrap,
)
from mav_tasks.settings import Driving

#: the goals that can be steered; ``legs`` splits every goal into these
Leg = Move | Rotate | Drive | Head | Wait | Follow
Line = Move | Follow  # metres of line, straight or not
Ending = Line | Rotate  # those with an end to come nearer to; the others last for a time

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
#: m/s², lateral acceleration in bends. ArduPilot's own limit is 0.6 g (ATC_TURN_MAX_G), at which
#: its simulated car (4.6.3) is far outside a bend before its wheels have turned
ACROSS = 0.5
#: m/s, limit for a bend that ends just before the path does. With 0.15 s of delay, 30 % overspeed
#: and half the commanded curvature, a place is then reached within 6 cm (p95), otherwise 13 cm
SLOW_BEND = 0.35
SETTLING = 2.5  # s until a vehicle is back on its path after a bend: five times REACH_TIME
PREVIEW = 0.2  # s until the wheels point as commanded
LEAST_REACH = 0.25  # m in which a heading error is corrected
REACH_TIME = 0.5  # s, the same for a fast vehicle, which reacts 0.2 s late
SLOWEST = 0.1  # m/s; a measured speed below it is too vague to compute a turn rate
#: m ahead on the path, the aim of a vehicle that is steered by course; metre-class GPS is off by
#: 0.2 m from one moment to the next
LOOKAHEAD = 1.0
LOOKAHEAD_TIME = 1.0  # s, the same for a fast vehicle


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


def clamped(value: float, most: float) -> float:
    """Return the value that is nearest to this one and within ±``most``."""
    return max(-most, min(most, value))


def has_arrived(leg: Leg, remaining: float, *, within: float, driving: Driving) -> bool:
    """Return whether ``remaining`` is within tolerance; ``within`` is a factor on the tolerance."""
    return _is_within(
        leg, remaining, within * driving.arrival_distance, within * driving.arrival_angle
    )


def is_settled(leg: Leg, remaining: float, *, driving: Driving) -> bool:
    """Return whether the end is near enough for a rover that can come no nearer."""
    metres = max(driving.settle_distance, driving.arrival_distance)
    return _is_within(leg, remaining, metres, max(driving.settle_angle, driving.arrival_angle))


def _is_within(leg: Leg, remaining: float, metres: float, angle: float) -> bool:
    """Return whether the end of a leg is this near; a time has to be over."""
    if isinstance(leg, Ending):
        return abs(remaining) <= (angle if isinstance(leg, Rotate) else metres)
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
    """Return the velocity towards the leg's end; ``steer_along`` does so for a path.

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
        case Rotate(angle=angle, rate=rate):
            towards_end = approach(
                remaining,
                top=rate or driving.turn_rate,
                braking=driving.turn_acceleration,
                gain=slowest.turn_gain,
                creep=slowest.rate,
            )
            turn = copysign(towards_end, angle * remaining)
            if not by_course:
                return Velocity(0.0, turn)
            # it turns by itself at its full rate: keep the lead small
            ahead = max(LEAST_AHEAD, AHEAD * abs(turn))
            lead = copysign(min(abs(remaining), ahead), turn)
            return Velocity(0.0, 0.0, wrap(pose.yaw + lead))
        case Drive(forward=forward, yaw_rate=yaw_rate):
            return Velocity(forward, yaw_rate, anchor.yaw if by_course else None)
        case Head(yaw=yaw, forward=forward):
            error = wrap(yaw - pose.yaw)
        case Wait() | Follow():
            return ZERO
    # it drives if its heading is about right, and turns otherwise; a car, or a vehicle that is
    # steered by course, drives slowly meanwhile instead of turning on the spot
    if by_course:
        slow = min(forward, BOW_SPEED) if is_far_off(error) else forward
        return Velocity(max(slow, 0.0), 0.0, wrap(pose.yaw + error))
    turn = clamped(HEADING_GAIN * error, MAX_STEER_RATE)
    if radius is None:
        return Velocity(0.0 if is_far_off(error) else forward, turn)
    slow = min(abs(forward), BOW_SPEED) if is_far_off(error) else abs(forward)
    return Velocity(copysign(slow, forward), clamped(turn, MORE_CURVATURE * slow / radius))


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
    back = atan(CROSS_TRACK_GAIN * cross_track(anchor, pose)) * speed_share
    return wrap(anchor.yaw - ahead * clamped(back, MAX_APPROACH_ANGLE) - pose.yaw)


def steer_along(
    leg: Follow,
    anchor: Pose,
    motion: Motion,
    *,
    along: float,
    remaining: float,
    driving: Driving,
    radius: float,
    passing: float = 0.0,
    by_course: bool = False,
    settles: bool = True,
    slowest: Slowest = USUAL,
) -> Velocity:
    """Return the velocity that drives the vehicle along its path, and back to it.

    ``along`` is its place on the path, ``remaining`` the rest, negative beyond the end. ``passing``
    is its speed at the end, m/s, if it goes on there. ``radius`` is its minimum turning radius, m.
    ``settles``: it shall be exact at the end, and not only on the way.
    """
    # a vehicle that is steered by course is less exact, and may not move at all at low speed: PX4's
    # simulated one does not at 0.5 m/s (1.17, factory gains)
    settles = settles and passing == 0.0 and not by_course
    bends = _speed_in_bends(leg, along, driving, settles=settles)
    top = min(leg.speed or driving.speed, bends)
    speed = approach(
        remaining,
        top=top,
        braking=driving.acceleration,
        gain=slowest.gain,
        creep=slowest.speed,
        at_end=passing,
    )
    if by_course:
        there = pose_on(anchor, leg.path, along + max(LOOKAHEAD, LOOKAHEAD_TIME * motion.speed))
        here = motion.pose
        return Velocity(speed, 0.0, atan2(there.east - here.east, there.north - here.north))
    forward = copysign(speed, direction_of(leg.path) * remaining)
    curvature = clamped(_curvature(leg, anchor, motion, along, forward), MORE_CURVATURE / radius)
    rolling = min(max(abs(motion.forward), min(speed, SLOWEST)), 2 * speed)
    return Velocity(forward, clamped(curvature * copysign(rolling, forward), driving.max_turn_rate))


def bend_speed(curvature: float, driving: Driving) -> float:
    """Return the highest speed in m/s for a circle of this curvature."""
    bend = abs(curvature)
    if bend == 0.0:
        return inf
    return min(driving.turn_rate / bend, sqrt(ACROSS / bend))


def _speed_in_bends(leg: Follow, along: float, driving: Driving, *, settles: bool) -> float:
    """Return the highest speed that still lets it slow down for every bend ahead.

    ``settles``: it leaves the last bend slowly enough to be back on its path at the end.
    """
    fastest, begins = inf, 0.0
    left = path_length(leg.path)
    for bend in leg.path:
        ends = begins + abs(bend.length)
        left -= abs(bend.length)
        if ends >= along:
            there = bend_speed(bend.curvature, driving)
            if there < inf and settles:
                there = min(there, max(SLOW_BEND, left / SETTLING))
            ahead = max(0.0, begins - along)
            fastest = min(fastest, sqrt(there * there + driving.acceleration * ahead))
        begins = ends
    return fastest


def _curvature(leg: Follow, anchor: Pose, motion: Motion, along: float, forward: float) -> float:
    """Return the path's curvature, corrected for heading error and cross-track error.

    Cross-track error e and heading error h change, for each metre, by d*h and d*(k - path's k),
    with d 1 forwards and -1 backwards. With reach r, k - path's k = -(h + d*e/2r) * d/r damps both.
    """
    path, d = leg.path, copysign(1.0, forward)
    reach = max(LEAST_REACH, REACH_TIME * motion.speed)
    on_path = min(max(along, 0.0), path_length(path))
    there = pose_on(anchor, path, along)
    error = wrap(motion.pose.yaw - there.yaw)
    back = clamped(cross_track(there, motion.pose) / (2 * reach), MAX_APPROACH_ANGLE)
    soon = min(on_path + PREVIEW * motion.speed, path_length(path))
    return curvature_at(path, soon) - d * (error + d * back) / reach
