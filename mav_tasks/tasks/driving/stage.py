"""A stage of a task (a single goal, or a step of a plan): its start, and the steps on the way."""

from dataclasses import replace
from math import inf, pi, radians
from typing import NamedTuple

from mav_tasks.settings import Driving, Turning
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.guidance import Motion, bend_speed, corner_speed, wrap
from mav_tasks.tasks.driving.legs import FACE, WAY, begun_from, begun_leg, heading_to
from mav_tasks.tasks.driving.mission_sequencer import goes_on_to_a_place
from mav_tasks.tasks.driving.path import bearing, distance, path_length, pose_on
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering, set_out_to
from mav_tasks.tasks.driving.recovery_path import resumed
from mav_tasks.tasks.goal import (
    Delay,
    Face,
    GoTo,
    LocalPlace,
    Near,
    Perform,
    Plan,
    SetSpeed,
    SingleGoal,
)
from mav_tasks.tasks.scheduler import place_of
from mav_tasks.tasks.task import Pose, Progress
from mav_tasks.tasks.view import VehicleView

#: rad; a car stops before a larger turn: it may be shorter to reverse
ROLLING_TURN = radians(100)
ROUND = 0.4  # m, radius of the way of what turns on the spot onto a circle
ROLLING = 0.05  # m/s; a vehicle that is faster goes on to its next place without stopping


class OnTheWay(NamedTuple):
    """The steps on the way that one look has done."""

    progress: Progress
    done: tuple[int, ...]
    performs: bool  # whether the last of them is a command to the vehicle


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
        here = replace(fresh, anchor=begun_from(goal, pose, done), leg=0, done=done, path=())
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
    return corner_speed(wrap(heading_to(goal, pose, target) - pose.yaw), lead=1.0) > 0.0


def look_on_the_way(
    plan: Plan, progress: Progress, *, to_place: float | None, elapsed: float
) -> OnTheWay:
    """Do those pending steps that are due.

    ``to_place`` is the metres to the place that is driven to, None without one; ``elapsed`` the
    seconds since the last look.
    """
    done: list[int] = []
    performs = False
    left_to_place = -inf if to_place is None else to_place
    for number in progress.pending:
        match plan.steps[number]:
            case Delay(seconds=seconds):
                waited = progress.pending_for + elapsed
                if waited < seconds:
                    progress = replace(progress, pending_for=waited)
                    break
                elapsed = waited - seconds
                progress = replace(progress, pending_for=0.0)
            case Near(distance=near) if left_to_place > near:
                break
            case SetSpeed(speed=speed):
                progress = replace(progress, speed=speed)
            case Perform():
                performs = True
        done.append(number)
        if performs:  # one at a time: the vehicle answers each
            break
    if done:
        progress = replace(progress, pending=progress.pending[len(done) :])
    return OnTheWay(progress, tuple(done), performs)
