"""Plans how an interrupted task gets back to its line, so that it ends where it would have ended.

After a pre-emption the vehicle may be anywhere; after a pause or a takeover it is near its line.
Errors that are cheap to correct on the way are left to steering.
"""

from dataclasses import replace
from math import copysign, cos, inf, radians, sin

from mav_tasks.tasks.driving.guidance import Motion, cross_track, done_so_far, wrap
from mav_tasks.tasks.driving.legs import FACE, WAY, anchor_of, distance, leg_of, length_of
from mav_tasks.tasks.driving.mission_sequencer import goal_of
from mav_tasks.tasks.driving.path import Follow, forward_of, nearest, pose_on
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering, set_out_to, way_to_pose
from mav_tasks.tasks.goal import GoTo, LocalPlace, Move, Rotate, SingleGoal
from mav_tasks.tasks.task import Pose, Progress, Task

ON_SPOT = 0.02  # m; nearer counts as there
OFF_TRACK = 1.0  # m off its line; farther off, a task does not resume after a takeover (lifecycle)
PAST_END = 0.1  # m, the same for the end of the line
CONVERGES = 6.0  # m of line in which steering corrects one metre of cross-track error
PUT_BACK = 0.3  # m against its direction; no estimate wanders as far in half a minute
BESIDE_PATH = 0.5  # m off a car's path; steering could not correct much more
ALIGNED = radians(10)  # rad; a smaller heading error is corrected on the way
TURNED = radians(30)  # rad; a smaller heading error cannot hide a whole turn


def is_off_line(task: Task, pose: Pose) -> bool:
    """Return whether the vehicle is so far from its task's line that a person must decide."""
    progress = task.progress
    anchor = progress.anchor
    if anchor is None:
        return False
    leg = leg_of(goal_of(task), progress)
    match leg:
        case Follow():
            along = nearest(anchor, leg.path, pose, around=progress.done, window=inf)
            return distance(pose, pose_on(anchor, leg.path, along)) > OFF_TRACK
        case Move():
            along = done_so_far(leg, anchor, pose, before=progress.done)
            beside = abs(cross_track(anchor, pose))
            return beside > OFF_TRACK or not -OFF_TRACK <= along <= length_of(leg) + PAST_END
        case Rotate():
            return distance(pose, anchor) > OFF_TRACK
        case _:
            return False


def was_handled(task: Task, before: Pose, after: Pose) -> bool:
    """Return whether somebody has moved a vehicle while it was silent.

    On a straight line a vehicle rolls on by itself, but does not turn or come back. Before its task
    drove it, it stays where it is.
    """
    if task.progress.anchor is None:
        return distance(before, after) > PUT_BACK or abs(wrap(after.yaw - before.yaw)) > TURNED
    leg = leg_of(goal_of(task), task.progress)
    if not isinstance(leg, Move):
        return False
    ahead = copysign(1.0, leg.distance) * forward_of(before, after)
    return ahead < -PUT_BACK or abs(wrap(after.yaw - before.yaw)) > TURNED


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
    anchor, pose = progress.anchor, motion.pose
    if not isinstance(goal, GoTo) or anchor is None or progress.target is None:
        return progress
    leg = leg_of(goal, progress)
    if isinstance(leg, Follow):
        is_near = steering is not None and _is_on_path(leg, anchor, pose, done=progress.done)
    elif progress.leg == WAY:
        along = done_so_far(leg, anchor, pose, before=progress.done)
        is_near = abs(cross_track(anchor, pose)) <= OFF_TRACK and 0 <= along <= length_of(leg)
    else:
        near_enough = max(goal.radius or 0.0, 2 * ON_SPOT)
        is_near = progress.leg > WAY and distance(pose, progress.target) <= near_enough
    if is_near:
        return progress
    if steering is not None:
        return set_out_to(goal, progress, pose, progress.target, steering)
    leg_again = FACE if turns_first else WAY
    again = anchor_of(goal, leg_again, pose, progress.target)
    return replace(progress, leg=leg_again, anchor=again, done=0.0, path=())


def _is_on_path(leg: Follow, anchor: Pose, pose: Pose, *, done: float) -> bool:
    """Return whether steering can return to a path by itself, near where it was left."""
    there = pose_on(anchor, leg.path, nearest(anchor, leg.path, pose, around=done))
    return distance(pose, there) <= BESIDE_PATH and abs(wrap(there.yaw - pose.yaw)) <= TURNED


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
    leg = leg_of(goal, progress)
    match leg:
        case Move():
            place = _entry(anchor, pose, leg, progress.done)
            if steering is not None and not honours_yaw_rate and _is_beside(anchor, pose, leg):
                return None
            if steering is not None:
                return _drive_back(
                    place,
                    leg,
                    progress,
                    motion,
                    steering=steering,
                    by_course=not honours_yaw_rate,
                )
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
    """Return where a move resumes on its line, or None if steering gets there by itself."""
    length = abs(leg.distance)
    along = done_so_far(leg, anchor, pose, before=done)
    beside = abs(cross_track(anchor, pose))
    on_line = -ON_SPOT <= along <= length + PAST_END
    if on_line and beside <= OFF_TRACK:
        if beside <= ON_SPOT or beside * CONVERGES <= length - along:
            return None
        at = min(along, length)
    else:
        at = min(max(done, 0.0), length)
    return _on_line(anchor, leg, at)


def _is_beside(anchor: Pose, pose: Pose, leg: Move) -> bool:
    """Return whether a car that does not reverse should go on from here, not drive a circle."""
    along = done_so_far(leg, anchor, pose, before=0.0)
    is_near = abs(cross_track(anchor, pose)) <= OFF_TRACK and -ON_SPOT <= along <= leg.distance
    return is_near and abs(wrap(anchor.yaw - pose.yaw)) <= TURNED


def _on_line(anchor: Pose, leg: Move, along: float) -> LocalPlace:
    signed = copysign(along, leg.distance)
    return LocalPlace(
        anchor.north + signed * cos(anchor.yaw), anchor.east + signed * sin(anchor.yaw)
    )


def _drive_back(
    place: LocalPlace | None,
    leg: Move,
    progress: Progress,
    motion: Motion,
    *,
    steering: Steering,
    by_course: bool,
) -> PathFollower | None:
    """Return a car's way to its line, on which it arrives with the heading of the line."""
    anchor, pose = progress.anchor, motion.pose
    assert anchor is not None, "what has begun has an anchor"
    if place is None:
        if abs(wrap(anchor.yaw - pose.yaw)) <= ALIGNED:
            return None
        place = _on_line(anchor, leg, min(max(progress.done, 0.0), length_of(leg)))
    entry = Pose(place.north, place.east, anchor.yaw)
    everywhere = replace(steering, fence=None)  # the fence still stops it on the way
    path = way_to_pose(pose, entry, steering) or way_to_pose(pose, entry, everywhere)
    assert path is not None, "there is a way to every pose"
    started = Progress(anchor=pose, target=place, leg=WAY, path=path)
    return PathFollower(GoTo(place), started, by_course=by_course, steering=steering)


def _course_there(place: LocalPlace, pose: Pose) -> PathFollower:
    goal = GoTo(place)
    started = Progress(anchor=anchor_of(goal, WAY, pose, place), target=place, leg=WAY)
    return PathFollower(goal, started, by_course=True)


def _course(place: LocalPlace, yaw: float, pose: Pose) -> PathFollower:
    goal = GoTo(place, yaw=yaw)
    return PathFollower(goal, Progress(anchor=anchor_of(goal, 0, pose, place), target=place))
