"""Splits a goal into legs, each counted from its own anchor.

A leg is a goal that ``guidance`` can steer. The legs depend only on the goal, on the pose where
each one began (``Progress.anchor``) and on the place meant (``Progress.target``). Hence a resumed
task drives the very same ones.
"""

from dataclasses import replace
from math import copysign, pi, tau

from mav_tasks.kinds import (
    Drive,
    Face,
    GoTo,
    Head,
    LocalPlace,
    Move,
    MoveTurned,
    Rotate,
    SingleGoal,
    Wait,
)
from mav_tasks.tasks.driving.guidance import Leg, wrap
from mav_tasks.tasks.driving.path import Follow, bearing, distance, moved, path_length
from mav_tasks.tasks.task import Pose, Progress

#: the legs of a GoTo: face the place (as a car: drive to where the last run to it begins), drive
#: there, then turn to ``yaw`` and wait, if asked for
FACE, WAY = range(2)


def leg_count(goal: SingleGoal) -> int:
    """Return the number of a goal's legs."""
    if isinstance(goal, GoTo):
        return 2 + (goal.yaw is not None) + (goal.wait > 0)
    return 3 if isinstance(goal, MoveTurned) else 1


def anchor_of(goal: SingleGoal, leg: int, pose: Pose, target: LocalPlace | None) -> Pose:
    """Return the anchor of a leg that begins at ``pose``."""
    if isinstance(goal, GoTo) and leg == WAY:
        assert target is not None, "the place was found before the task began"
        return replace(pose, yaw=heading_to(goal, pose, target))
    return pose


def begun_leg(goal: SingleGoal, progress: Progress, leg: int, pose: Pose) -> Progress:
    """Return the progress with which a leg begins at a pose."""
    anchor = anchor_of(goal, leg, pose, progress.target)
    return replace(progress, leg=leg, anchor=anchor, done=0.0, path=())


def heading_to(goal: GoTo, pose: Pose, target: LocalPlace) -> float:
    """Return the heading of the vehicle when it drives straight to a place."""
    return bearing(pose, target) + pi * goal.backwards


def leg_of(goal: SingleGoal, progress: Progress) -> Leg:
    """Return the leg that is being driven."""
    anchor = progress.anchor
    assert anchor is not None, "a leg is driven from its anchor"
    match goal:
        case MoveTurned(distance=metres, speed=speed):
            return Move(metres, speed) if progress.leg == WAY else Rotate(pi)
        case Head(yaw=yaw, is_relative=True):
            return replace(goal, yaw=wrap(anchor.yaw + yaw), is_relative=False)
        case Face(yaw=yaw, direction=direction, rate=rate):
            return Rotate(_turn(anchor.yaw, yaw, direction), rate)
        case GoTo():
            return _leg_of_way(goal, progress, anchor)
        case _:
            return goal


def length_of(leg: Leg) -> float:
    """Return the whole length of a leg, unsigned: metres, radians or seconds."""
    match leg:
        case Move(distance=metres):
            return abs(metres)
        case Rotate(angle=angle):
            return abs(angle)
        case Follow(path=path):
            return path_length(path)
        case Drive(duration=duration) | Head(duration=duration) | Wait(duration=duration):
            return duration


def begun_from(goal: SingleGoal, pose: Pose, done: float) -> Pose:
    """Return the anchor of a goal if a vehicle that stands at ``pose`` has already driven ``done``.

    It is for a task that resumes from here because its own anchor is lost.
    """
    match goal:
        case Move(distance=metres):
            return moved(pose, 0.0, -copysign(done, metres))
        case Rotate(angle=angle):
            return replace(pose, yaw=wrap(pose.yaw - copysign(done, angle)))
        case _:
            return pose


def _leg_of_way(goal: GoTo, progress: Progress, anchor: Pose) -> Leg:
    if progress.leg <= WAY:
        assert progress.target is not None, "the place was found before the task began"
        if progress.path:
            return Follow(progress.path, goal.speed)
        if progress.leg == FACE:
            return Rotate(wrap(heading_to(goal, anchor, progress.target) - anchor.yaw))
        way = distance(anchor, progress.target)
        if goal.turns:  # only to estimate it: the way onto it is planned when it begins
            return Move(way + tau * goal.turns * abs(goal.around), goal.speed)
        return Move(-way if goal.backwards else way, goal.speed)
    if progress.leg == WAY + 1 and goal.yaw is not None:
        return Rotate(_turn(anchor.yaw, goal.yaw, 0))
    return Wait(goal.wait)


def _turn(have: float, want: float, direction: int) -> float:
    """Return the angle between two headings, in ``direction``, or the shorter way if that is 0."""
    short = wrap(want - have)
    if direction == 0 or short * direction >= 0 or abs(abs(short) - pi) < 1e-9:
        return copysign(short, direction) if direction else short
    return short + direction * tau
