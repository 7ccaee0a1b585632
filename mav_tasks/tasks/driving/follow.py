"""Path following for a car: (path, where the vehicle is) → the velocity to command. Stateless.

The loop is closed: the curvature is the path's, plus a correction that leads back to the path.
"""

from math import atan2, copysign, inf, sqrt

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import (
    MAX_APPROACH_ANGLE,
    MORE_CURVATURE,
    USUAL,
    Motion,
    Slowest,
    Velocity,
    approach,
    wrap,
)
from mav_tasks.tasks.driving.path import Follow, beside, curvature_at, path_length, pose_on
from mav_tasks.tasks.task import Pose

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
    forward = copysign(speed, -remaining if leg.is_reverse else remaining)
    most = MORE_CURVATURE / radius
    curvature = max(-most, min(most, _curvature(leg, anchor, motion, along, forward)))
    rate = curvature * _rolling(forward, motion)
    return Velocity(forward, max(-driving.max_turn_rate, min(driving.max_turn_rate, rate)))


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
    error = wrap(motion.pose.yaw - pose_on(anchor, path, along).yaw)
    back = beside(anchor, path, motion.pose, along) / (2 * reach)
    back = max(-MAX_APPROACH_ANGLE, min(MAX_APPROACH_ANGLE, back))
    soon = min(on_path + PREVIEW * motion.speed, path_length(path))
    return curvature_at(path, soon) - d * (error + d * back) / reach


def _rolling(forward: float, motion: Motion) -> float:
    """Return the speed that turns a curvature into a turn rate: the measured one, bounded."""
    asked = abs(forward)
    return copysign(min(max(abs(motion.forward), min(asked, SLOWEST)), 2 * asked), forward)
