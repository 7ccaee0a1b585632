"""How an interrupted task gets back to where it was, so that it ends where it would have ended.

A task that another one pre-empted may find the vehicle anywhere; after a pause or a takeover it is
near its line. What is cheap to correct on the way is left to steering.
"""

from dataclasses import replace
from math import copysign, cos, hypot, radians, sin

from mav_tasks.tasks.course import Course
from mav_tasks.tasks.goal import GoTo, LocalPlace, Move, Rotate, SingleGoal
from mav_tasks.tasks.guidance import Motion, cross_track, done_so_far, wrap
from mav_tasks.tasks.itinerary import goal_of
from mav_tasks.tasks.legs import FACE, WAY, anchor_of, distance, leg_of, length_of
from mav_tasks.tasks.task import Pose, Progress, Task

ON_SPOT = 0.02  # m from where it was: as good as there
OFF_LINE = 1.0  # m, lifecycle: further off its line than this is no resumption after a takeover
PAST_END = 0.1  # m, the same for the end of the line
CONVERGES = 6.0  # m of line for each metre beside it, in which steering comes back to it
ALIGNED = radians(10)  # a heading that differs by less is put right on the way
TURNED = radians(30)  # a heading that differs by less cannot be mistaken by a whole turn


def is_off_line(task: Task, pose: Pose) -> bool:
    """Whether somebody has taken a vehicle so far from its task that nobody should guess."""
    progress = task.progress
    anchor = progress.anchor
    if anchor is None:
        return False
    leg = leg_of(goal_of(task), progress)
    match leg:
        case Move():
            along = done_so_far(leg, anchor, pose, before=progress.done)
            beside = abs(cross_track(anchor, pose))
            return beside > OFF_LINE or not -OFF_LINE <= along <= length_of(leg) + PAST_END
        case Rotate():
            return hypot(pose.north - anchor.north, pose.east - anchor.east) > OFF_LINE
        case _:
            return False


def resumed(
    goal: SingleGoal, progress: Progress, motion: Motion, *, honours_yaw_rate: bool
) -> Progress:
    """Give the progress with which to go on from here.

    A way to a place that was left far behind is simply begun again from here.
    """
    anchor, pose = progress.anchor, motion.pose
    if not isinstance(goal, GoTo) or anchor is None or progress.target is None:
        return progress
    leg = leg_of(goal, progress)
    if progress.leg == WAY:
        along = done_so_far(leg, anchor, pose, before=progress.done)
        is_near = abs(cross_track(anchor, pose)) <= OFF_LINE and 0 <= along <= length_of(leg)
    else:
        near_enough = max(goal.radius or 0.0, 2 * ON_SPOT)
        is_near = progress.leg > WAY and distance(pose, progress.target) <= near_enough
    if is_near:
        return progress
    leg_again = FACE if honours_yaw_rate else WAY
    again = anchor_of(goal, leg_again, pose, progress.target)
    return replace(progress, leg=leg_again, anchor=again, done=0.0)


def way_back(
    goal: SingleGoal, progress: Progress, motion: Motion, *, honours_yaw_rate: bool
) -> Course | None:
    """Give the way to where the task can go on exactly, or None if that is here.

    One that does not turn on the spot finds its heading while it drives on.
    """
    anchor, pose = progress.anchor, motion.pose
    assert anchor is not None, "what has begun has an anchor"
    leg = leg_of(goal, progress)
    match leg:
        case Move():
            place = _entry(anchor, pose, leg, progress.done)
            if not honours_yaw_rate:
                return None if place is None else _course_there(place, pose)
            if place is None and abs(wrap(anchor.yaw - pose.yaw)) > ALIGNED:
                place = LocalPlace(pose.north, pose.east)  # turn here, or it would leave the line
            return None if place is None else _course(place, anchor.yaw, pose)
        case Rotate(angle=angle):
            yaw = wrap(anchor.yaw + copysign(progress.done, angle))
            spot = LocalPlace(anchor.north, anchor.east)
            if distance(pose, spot) <= ON_SPOT and abs(wrap(yaw - pose.yaw)) <= TURNED:
                return None
            return _course(spot, yaw, pose)
        case _:
            return None


def _entry(anchor: Pose, pose: Pose, leg: Move, done: float) -> LocalPlace | None:
    """Where on its line a move is to be resumed, unless steering gets there by itself."""
    length = abs(leg.distance)
    along = done_so_far(leg, anchor, pose, before=done)
    beside = abs(cross_track(anchor, pose))
    on_line = -ON_SPOT <= along <= length + PAST_END
    if on_line and beside <= OFF_LINE:
        if beside <= ON_SPOT or beside * CONVERGES <= length - along:
            return None
        at = min(along, length)
    else:
        at = min(max(done, 0.0), length)
    signed = copysign(at, leg.distance)
    return LocalPlace(
        anchor.north + signed * cos(anchor.yaw), anchor.east + signed * sin(anchor.yaw)
    )


def _course_there(place: LocalPlace, pose: Pose) -> Course:
    goal = GoTo(place)
    begun = Progress(anchor=anchor_of(goal, WAY, pose, place), target=place, leg=WAY)
    return Course(goal, begun, by_course=True)


def _course(place: LocalPlace, yaw: float, pose: Pose) -> Course:
    goal = GoTo(place, yaw=yaw)
    return Course(goal, Progress(anchor=anchor_of(goal, 0, pose, place), target=place))
