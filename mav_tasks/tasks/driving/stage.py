"""Where a task, or a step of a plan, starts or resumes, and its way back there.

After a pre-emption the vehicle may be anywhere; after a pause or a takeover it is near its line.
Errors that are cheap to correct on the way are left to steering. An interrupted task ends where it
would have ended.
"""

from dataclasses import replace
from math import copysign, inf, pi, radians

from mav_tasks.kinds import Face, GoTo, LocalPlace, Move, Pose, Rotate, SingleGoal
from mav_tasks.kinds.base import FACE, WAY
from mav_tasks.kinds.path import (
    Follow,
    bearing,
    distance,
    moved,
    nearest,
    path_length,
    pose_on,
    seen_from,
    wrap,
)
from mav_tasks.settings import Driving, Turning
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.guidance import Motion, bend_speed, corner_speed
from mav_tasks.tasks.driving.legs import begun_leg
from mav_tasks.tasks.driving.mission_sequencer import goal_of, goes_on_to_a_place
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering, set_out_to, way_to_pose
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.task import Progress, Task
from mav_tasks.tasks.view import VehicleView, place_of

#: rad; a car stops before a larger turn: it may be shorter to reverse
ROLLING_TURN = radians(100)
ROUND = 0.4  # m, radius of the way of what turns on the spot onto a circle
ROLLING = 0.05  # m/s; a vehicle that is faster goes on to its next place without stopping

ON_SPOT = 0.02  # m; nearer counts as there
OFF_TRACK = 1.0  # m off its line; farther off, a task does not resume after a takeover (lifecycle)
PAST_END = 0.1  # m, the same for the end of the line
CONVERGES = 6.0  # m of line in which steering corrects one metre of cross-track error
PUT_BACK = 0.3  # m against its direction; no estimate wanders as far in half a minute
BESIDE_PATH = 0.5  # m off a car's path; steering could not correct much more
ALIGNED = radians(10)  # rad; a smaller heading error is corrected on the way
TURNED = radians(30)  # rad; a smaller heading error cannot hide a whole turn


def set_out(
    goal: SingleGoal, progress: Progress, seen: VehicleView, motion: Motion, bounds: Bounds
) -> PathFollower | None:
    """Return the follower of a goal that starts or resumes here; None if its place is unknown."""
    steering, target, pose = _steering(goal, seen, bounds), _target(goal, seen), motion.pose
    turns_first = seen.honours_yaw_rate and steering is None
    is_return = isinstance(goal, GoTo) and goal.place is None
    fresh = replace(progress, frame=seen.frame, target=target)
    if progress.anchor is not None and not (is_return and target != progress.target):
        here = resumed(goal, progress, motion, turns_first=turns_first, steering=steering)
    elif not isinstance(goal, GoTo):
        done = 0.0 if isinstance(goal, Face) else progress.done  # its heading is absolute
        here = replace(fresh, anchor=goal.begun_from(pose, done), leg=0, done=done, path=())
    elif target is None:
        return None
    elif steering is not None:
        here = set_out_to(goal, fresh, pose, target, steering)
    else:
        is_rolling = motion.speed > ROLLING and _bends_gently(goal, pose, target)
        here = begun_leg(goal, fresh, FACE if turns_first and not is_rolling else WAY, pose)
    return PathFollower(goal, here, by_course=not seen.honours_yaw_rate, steering=steering)


def may_go_on_rolling(
    goal: SingleGoal, progress: Progress, seen: VehicleView, motion: Motion, bounds: Bounds
) -> bool:
    """Return whether a goal can begin without a stop."""
    steering, target, pose = _steering(goal, seen, bounds), _target(goal, seen), motion.pose
    if target is None or not isinstance(goal, GoTo):
        return False
    if steering is not None:
        return set_out_to(goal, progress, pose, target, steering).leg == WAY
    return _bends_gently(goal, pose, target)


def lead_on(course: PathFollower, plan: Plan, seen: VehicleView, *, driving: Driving) -> None:
    """Let a course pass its place, if the plan allows it and goes on to another one."""
    goal, progress = course.goal, course.progress
    target = progress.target
    following = goes_on_to_a_place(plan, progress)
    after = None if following is None else place_of(following, seen)
    if not (isinstance(goal, GoTo) and goal.passes) or target is None or after is None:
        return
    here = Pose(target.north, target.east, bearing(course.anchor, target))
    if progress.path:
        at_end = pose_on(course.anchor, progress.path, path_length(progress.path))
        here = replace(here, yaw=at_end.yaw + pi * goal.backwards)
    course.within = min(goal.radius or driving.acceptance_radius, distance(here, after) / 2)
    turn = wrap(bearing(here, after) - here.yaw)
    speed = corner_speed(turn, lead=course.within)
    if course.steering is not None:  # where a car begins its turn; 0: it stops
        bend = bend_speed(1 / course.steering.planned_radius, driving)
        speed = bend if abs(turn) <= ROLLING_TURN else 0.0
    course.passing = min(driving.max_speed, speed)


def is_off_line(task: Task, pose: Pose) -> bool:
    """Return whether the vehicle is so far from its task's line that a person must decide."""
    progress = task.progress
    anchor = progress.anchor
    if anchor is None:
        return False
    leg = goal_of(task).leg_of(progress)
    match leg:
        case Follow(path=path):
            along = nearest(anchor, path, pose, around=progress.done, window=inf)
            return distance(pose, pose_on(anchor, path, along)) > OFF_TRACK
        case Move():
            along, beside = _place_at(leg, anchor, pose)
            return beside > OFF_TRACK or not -OFF_TRACK <= along <= leg.length + PAST_END
        case Rotate():
            return distance(pose, anchor) > OFF_TRACK
        case _:
            return False


def was_handled(task: Task, before: Pose, after: Pose) -> bool:
    """Return whether somebody has moved a vehicle while it was silent.

    On a straight line a vehicle rolls on by itself, but does not turn or come back. Before its task
    drove it, it stays where it is.
    """
    has_turned = _is_turned(before, after, TURNED)
    if task.progress.anchor is None:
        return has_turned or distance(before, after) > PUT_BACK
    leg = goal_of(task).leg_of(task.progress)
    return isinstance(leg, Move) and (has_turned or _place_at(leg, before, after)[0] < -PUT_BACK)


def resumed(
    goal: SingleGoal,
    progress: Progress,
    motion: Motion,
    *,
    turns_first: bool,
    steering: Steering | None = None,
) -> Progress:
    """Return the progress with which to resume from here.

    The way to a place begins again here if the vehicle is far off it; ``turns_first``: with a turn
    on the spot.
    """
    anchor, pose, target = progress.anchor, motion.pose, progress.target
    if not isinstance(goal, GoTo) or anchor is None or target is None:
        return progress
    leg, is_near = goal.leg_of(progress), False
    if isinstance(leg, Follow):  # steering can return to a path by itself, near where it was left
        there = pose_on(anchor, leg.path, nearest(anchor, leg.path, pose, around=progress.done))
        is_turned = _is_turned(pose, there, TURNED)
        is_near = distance(pose, there) <= BESIDE_PATH and not is_turned and steering is not None
    elif isinstance(leg, Move):
        along, beside = _place_at(leg, anchor, pose)
        is_near = beside <= OFF_TRACK and 0 <= along <= leg.length
    elif progress.leg > WAY:
        is_near = distance(pose, target) <= max(goal.radius or 0.0, 2 * ON_SPOT)
    if is_near:
        return progress
    if steering is not None:
        return set_out_to(goal, progress, pose, target, steering)
    return begun_leg(goal, progress, FACE if turns_first else WAY, pose)


def recovery_path(
    goal: SingleGoal,
    progress: Progress,
    motion: Motion,
    *,
    honours_yaw_rate: bool,
    steering: Steering | None = None,
) -> PathFollower | None:
    """Return the way to where the task can resume exactly, or None if that is here.

    A vehicle that is steered by course corrects its heading while it drives on, unless it is a car.
    """
    anchor, pose = progress.anchor, motion.pose
    assert anchor is not None, "what has begun has an anchor"
    leg = goal.leg_of(progress)
    if isinstance(leg, Rotate):
        there = replace(anchor, yaw=wrap(anchor.yaw + copysign(progress.done, leg.angle)))
        if distance(pose, there) <= ON_SPOT and not _is_turned(pose, there, TURNED):
            return None
        return _way_back(there, pose, by_course=not honours_yaw_rate, steering=None)
    if not isinstance(leg, Move):
        return None
    along, beside = _place_at(leg, anchor, pose)
    by_course, is_car, length = not honours_yaw_rate, steering is not None, leg.length
    at, steers_back = min(max(progress.done, 0.0), length), False
    if -ON_SPOT <= along <= length + PAST_END and beside <= OFF_TRACK:
        steers_back = beside <= ON_SPOT or beside * CONVERGES <= length - along
        at = at if steers_back else min(along, length)
        if is_car and by_course and along <= leg.distance and not _is_turned(pose, anchor, TURNED):
            return None  # it would drive a circle
    if steers_back:
        if not _is_turned(pose, anchor, ALIGNED) or (by_course and not is_car):
            return None
        if not is_car:  # turn here, or it would leave the line
            return _way_back(replace(pose, yaw=anchor.yaw), pose, by_course=False, steering=None)
    there = moved(anchor, 0.0, copysign(at, leg.distance))
    return _way_back(there, pose, by_course=by_course, steering=steering)


def _way_back(
    there: Pose, pose: Pose, *, by_course: bool, steering: Steering | None
) -> PathFollower:
    """Return the way to a pose. A car arrives with its heading; another one turns there."""
    place = LocalPlace(there.north, there.east)
    if steering is None and not by_course:
        return PathFollower(GoTo(place, yaw=there.yaw), Progress(anchor=pose, target=place))
    goal = GoTo(place)
    begun = begun_leg(goal, Progress(target=place), WAY, pose)
    if steering is not None:
        path = way_to_pose(pose, there, steering)
        if path is None:  # the fence still stops it on the way
            path = way_to_pose(pose, there, replace(steering, fence=None)) or ()
        begun = replace(begun, anchor=pose, path=path)
    return PathFollower(goal, begun, by_course=by_course, steering=steering)


def _place_at(line: Move, anchor: Pose, pose: Pose) -> tuple[float, float]:
    """Return the metres of a pose along the line of a move, and to either side of it."""
    there = seen_from(anchor, pose)
    return copysign(1.0, line.distance) * there.real, abs(there.imag)


def _is_turned(pose: Pose, other: Pose, most: float) -> bool:
    return abs(wrap(other.yaw - pose.yaw)) > most


def _steering(goal: SingleGoal, seen: VehicleView, bounds: Bounds) -> Steering | None:
    """Return the constraints on a car's ways; None for a vehicle that turns on the spot.

    What turns on the spot does not do so on its way onto a circle.
    """
    is_car = seen.turning is Turning.STEERED
    if not is_car and not (isinstance(goal, GoTo) and goal.turns):
        return None
    radius = seen.turning_radius if is_car else ROUND
    return Steering(radius, seen.honours_yaw_rate, bounds.local(seen.origin))


def _target(goal: SingleGoal, seen: VehicleView) -> LocalPlace | None:
    return place_of(goal, seen) if isinstance(goal, GoTo) else None


def _bends_gently(goal: GoTo, pose: Pose, target: LocalPlace) -> bool:
    return corner_speed(wrap(goal.heading_to(pose, target) - pose.yaw), lead=1.0) > 0.0
