"""Where a task, or a step of a plan, starts or resumes, and its way back there.

After a pre-emption the vehicle may be anywhere; after a pause or a takeover it is near its line.
Errors that are cheap to correct on the way are left to steering. An interrupted task ends where it
would have ended.
"""

from dataclasses import replace
from math import pi, radians

from mav_tasks.config.settings import Driving, Turning
from mav_tasks.kinds import GoTo, LocalPlace, Pose, SingleGoal
from mav_tasks.kinds.base import FACE, ON_SPOT, TURNED, WAY, is_turned
from mav_tasks.kinds.guidance import Motion, bend_speed, corner_speed
from mav_tasks.kinds.path import (
    bearing,
    distance,
    path_length,
    pose_on,
    wrap,
)
from mav_tasks.tasks.driving.bounds import Bounds
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

PUT_BACK = 0.3  # m; no estimate of what stands wanders as far in half a minute


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
        done = 0.0 if goal.is_absolute else progress.done
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
    return goal_of(task).leg_of(progress).is_left(anchor, pose, progress.done)


def was_handled(task: Task, before: Pose, after: Pose) -> bool:
    """Return whether somebody has moved a vehicle while it was silent.

    Before its task drove it, it stays where it is.
    """
    if task.progress.anchor is None:
        return is_turned(before, after, TURNED) or distance(before, after) > PUT_BACK
    return goal_of(task).leg_of(task.progress).was_handled(before, after)


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
    if progress.leg > WAY:
        is_near = distance(pose, target) <= max(goal.radius or 0.0, 2 * ON_SPOT)
    else:
        is_car, leg = steering is not None, goal.leg_of(progress)
        is_near = leg.goes_on_from(anchor, pose, progress.done, is_car=is_car)
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
    """Return the way to where the task can resume exactly, or None if that is here."""
    anchor, by_course, is_car = progress.anchor, not honours_yaw_rate, steering is not None
    assert anchor is not None, "what has begun has an anchor"
    there = goal.leg_of(progress).way_back(
        anchor, motion.pose, progress.done, by_course=by_course, is_car=is_car
    )
    if there is None:
        return None
    return _way_back(there, motion.pose, by_course=by_course, steering=steering)


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
