"""A stage of a task (a single goal, or a step of a plan): its start, and the steps on the way."""

from dataclasses import dataclass, replace
from math import inf, pi, radians

from mav_tasks.settings import Driving, Turning
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.follow import bend_speed
from mav_tasks.tasks.driving.guidance import Motion, corner_speed, wrap
from mav_tasks.tasks.driving.legs import (
    FACE,
    WAY,
    anchor_of,
    bearing,
    begun_from,
    distance,
    heading_to,
)
from mav_tasks.tasks.driving.mission_sequencer import goes_on_to_a_place, present_goal, started
from mav_tasks.tasks.driving.path import path_length, pose_on
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering, set_out_to
from mav_tasks.tasks.driving.recovery_path import resumed
from mav_tasks.tasks.goal import (
    Delay,
    Face,
    Goal,
    GoTo,
    LocalPlace,
    Near,
    Perform,
    Plan,
    SetSpeed,
    SingleGoal,
)
from mav_tasks.tasks.task import Pose, Progress
from mav_tasks.tasks.view import VehicleView, place_of

#: rad; a car stops before a larger turn: it may be shorter to reverse
ROLLING_TURN = radians(100)
ROUND = 0.4  # m, radius of the way of what turns on the spot onto a circle
ROLLING = 0.05  # m/s; a vehicle that is faster goes on to its next place without stopping


@dataclass(frozen=True, slots=True)
class OnTheWay:
    """The steps on the way that one look has done."""

    progress: Progress
    done: tuple[int, ...] = ()
    performed: tuple[int, ...] = ()  # of those, commands to the vehicle


def steering_of(goal: SingleGoal, seen: VehicleView, bounds: Bounds) -> Steering | None:
    """Return the constraints on a car's ways; None for a vehicle that turns on the spot.

    What turns on the spot does not do so on its way onto a circle.
    """
    radius = seen.turning_radius
    if seen.turning is not Turning.STEERED:
        if not isinstance(goal, GoTo) or not goal.turns:
            return None
        radius = ROUND
    return Steering(radius, seen.honours_yaw_rate, bounds.local(seen.origin))


def set_out(
    goal: Goal,
    progress: Progress,
    seen: VehicleView,
    motion: Motion,
    *,
    steering: Steering | None = None,
) -> Progress | None:
    """Return the progress with which a task starts or resumes here; None if its place is unknown.

    ``steering`` is that of a vehicle that steers as a car.
    """
    if isinstance(goal, Plan) and progress.step < 0:
        progress = started(goal, progress)
    single = present_goal(goal, progress)
    turns_first = seen.honours_yaw_rate and steering is None
    if progress.anchor is not None and not _has_home_moved(single, progress, seen):
        return resumed(single, progress, motion, turns_first=turns_first, steering=steering)
    if not isinstance(single, GoTo):
        done = 0.0 if isinstance(single, Face) else progress.done  # its heading is absolute
        anchor = begun_from(single, anchor_of(single, 0, motion.pose, None), done)
        begun_here = replace(progress, anchor=anchor, frame=seen.frame, leg=0, done=done)
        return replace(begun_here, target=None, path=())
    target = place_of(single, seen)
    if target is None:
        return None
    if steering is not None:
        placed = replace(progress, frame=seen.frame, target=target)
        return set_out_to(single, placed, motion.pose, target, steering)
    is_rolling = motion.speed > ROLLING and _bends_gently(single, motion, target)
    leg = WAY if is_rolling or not turns_first else FACE
    anchor = anchor_of(single, leg, motion.pose, target)
    begun_here = replace(progress, anchor=anchor, frame=seen.frame, leg=leg, done=0.0)
    return replace(begun_here, target=target, path=())


def _has_home_moved(goal: SingleGoal, progress: Progress, seen: VehicleView) -> bool:
    """Return whether a return that was interrupted leads to another place now."""
    if not isinstance(goal, GoTo) or goal.place is not None:
        return False
    return place_of(goal, seen) != progress.target


def may_go_on_rolling(
    goal: Goal,
    progress: Progress,
    seen: VehicleView,
    motion: Motion,
    *,
    steering: Steering | None = None,
) -> bool:
    """Return whether a stage can begin without a stop."""
    single = present_goal(goal, progress)
    target = place_of(single, seen) if isinstance(single, GoTo) else None
    if target is None or not isinstance(single, GoTo):
        return False
    if steering is not None:
        return set_out_to(single, progress, motion.pose, target, steering).leg == WAY
    return _bends_gently(single, motion, target)


def _bends_gently(goal: GoTo, motion: Motion, target: LocalPlace) -> bool:
    return corner_speed(_off(motion.pose, heading_to(goal, motion.pose, target)), lead=1.0) > 0.0


def course_of(
    goal: Goal,
    progress: Progress,
    seen: VehicleView,
    *,
    driving: Driving,
    steering: Steering | None = None,
) -> PathFollower:
    """Return the path follower of the current stage, which may lead on to the next place."""
    single = present_goal(goal, progress)
    by_course = not seen.honours_yaw_rate
    stopping = PathFollower(single, progress, by_course=by_course, steering=steering)
    if not (isinstance(goal, Plan) and isinstance(single, GoTo) and single.passes):
        return stopping
    target, anchor = progress.target, progress.anchor
    following = goes_on_to_a_place(goal, progress)
    after = None if following is None else place_of(following, seen)
    if after is None or target is None or anchor is None:
        return stopping
    here = Pose(target.north, target.east, bearing(anchor, target))
    if progress.path:
        at_end = pose_on(anchor, progress.path, path_length(progress.path))
        here = replace(here, yaw=at_end.yaw + pi * single.backwards)
    within = min(single.radius or driving.acceptance_radius, distance(here, after) / 2)
    turn = _off(here, bearing(here, after))
    speed = corner_speed(turn, lead=within)
    if steering is not None:  # where a car begins its turn; 0: it stops
        bend = bend_speed(1 / steering.planned_radius, driving)
        speed = bend if abs(turn) <= ROLLING_TURN else 0.0
    return PathFollower(
        single,
        progress,
        passing=min(driving.max_speed, speed),
        within=within,
        by_course=by_course,
        steering=steering,
    )


def _off(pose: Pose, yaw: float) -> float:
    return wrap(yaw - pose.yaw)


def look_on_the_way(
    plan: Plan, progress: Progress, *, to_place: float | None, elapsed: float
) -> OnTheWay:
    """Do those pending steps that are due.

    ``to_place`` is the metres to the place that is driven to, None without one; ``elapsed`` the
    seconds since the last look.
    """
    done: list[int] = []
    performed: list[int] = []
    left_to_place = -inf if to_place is None else to_place
    for number in progress.pending:
        step = plan.steps[number]
        match step:
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
                performed.append(number)
        done.append(number)
        if performed:  # one at a time: the vehicle answers each
            break
    if done:
        progress = replace(progress, pending=progress.pending[len(done) :])
    return OnTheWay(progress, tuple(done), tuple(performed))
