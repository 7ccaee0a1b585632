"""Rough durations of tasks, for people who wait; and their ways, which limits of clients bound.

A goal is followed leg by leg from where the vehicle is. The estimate ignores other traffic,
corrections near the end, pauses, and a car's bends, but for those of the run that it drives.
"""

from math import cos, nan, sin, sqrt
from typing import NamedTuple

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import Leg, wrap
from mav_tasks.tasks.driving.legs import WAY, anchor_of, leg_count, leg_of, length_of
from mav_tasks.tasks.driving.mission_sequencer import following, is_over, present_goal, started
from mav_tasks.tasks.driving.path import Follow
from mav_tasks.tasks.frames import local_place
from mav_tasks.tasks.goal import (
    Drive,
    Face,
    GlobalPlace,
    Goal,
    GoTo,
    Head,
    LocalPlace,
    Move,
    Plan,
    Rotate,
    SetSpeed,
    SingleGoal,
    Wait,
)
from mav_tasks.tasks.task import Pose, Progress

SETTLING = 1.5  # s from one task's end to motion, and from near its end to a measured standstill
MOST_STEPS = 300  # of a plan; a longer one has no estimate
SOMEWHERE = Pose(0.0, 0.0, 0.0)


class Known(NamedTuple):
    """Inputs of an estimate; None: not known."""

    driving: Driving
    pose: Pose | None = None
    home: GlobalPlace | None = None
    origin: GlobalPlace | None = None


class Estimate(NamedTuple):
    """Seconds that a goal takes, where the vehicle is then, and its way there; NaN: not known."""

    seconds: float
    pose: Pose | None
    metres: float = 0.0


UNKNOWN = Estimate(nan, None, nan)


def time_left(goal: Goal, progress: Progress, known: Known) -> Estimate:
    """Return how long a task still takes; all of it if it has not started."""
    if isinstance(goal, Plan):
        return _time_of_plan(goal, progress, known)
    return _time_of_goal(goal, progress, known, known.driving.speed)


def _time_of_plan(plan: Plan, progress: Progress, known: Known) -> Estimate:
    progress = progress if progress.step >= 0 else started(plan, progress)
    speed = progress.speed or known.driving.speed
    seconds, pose, metres = 0.0, known.pose, 0.0
    for _ in range(MOST_STEPS):
        for step in progress.pending:
            present = plan.steps[step]
            if isinstance(present, SetSpeed):
                speed = present.speed or known.driving.speed
        if is_over(plan, progress):
            return Estimate(seconds, pose, metres)
        goal = present_goal(plan, progress)
        took, pose, way = _time_of_goal(goal, progress, known._replace(pose=pose), speed)
        seconds += took
        metres += way
        after = following(plan, progress)
        if after is None or took != took:  # from an unknown place the rest is unknown, too
            break
        progress = after
    return UNKNOWN


def _time_of_goal(goal: SingleGoal, progress: Progress, known: Known, speed: float) -> Estimate:
    target = progress.target
    if target is None and isinstance(goal, GoTo):
        target = local_place(known.home if goal.place is None else goal.place, known.origin)
    pose = known.pose
    if progress.anchor is None and isinstance(goal, GoTo) and target is None:
        return UNKNOWN
    if pose is None and progress.anchor is None and isinstance(goal, GoTo | Face):
        return UNKNOWN
    at, seconds, metres = pose or SOMEWHERE, SETTLING, 0.0
    for number in range(progress.leg, leg_count(goal)):
        if number == progress.leg and progress.anchor is not None:
            anchor, done, leg = progress.anchor, progress.done, leg_of(goal, progress)
        else:
            anchor, done = anchor_of(goal, number, at, target), 0.0
            leg = leg_of(goal, Progress(anchor=anchor, leg=number, target=target))
        left = max(0.0, length_of(leg) - done)
        seconds += _seconds(leg, left, known.driving, speed)
        metres += _way(leg, left)
        at = _end_of(leg, anchor, target if number == WAY else None)
    return Estimate(seconds, None if pose is None and progress.anchor is None else at, metres)


def _end_of(leg: Leg, anchor: Pose, place: LocalPlace | None) -> Pose:
    """Return the end of a leg that begins at ``anchor``; ``place`` is the end of a go-to."""
    north, east, yaw = anchor.north, anchor.east, anchor.yaw
    if place is not None:
        return Pose(place.north, place.east, yaw)
    match leg:
        case Move(distance=way):
            return Pose(north + way * cos(yaw), east + way * sin(yaw), yaw)
        case Rotate(angle=angle):
            return Pose(north, east, wrap(yaw + angle))
        case Head(yaw=heading, forward=forward, duration=duration):
            way = forward * duration
            return Pose(north + way * cos(heading), east + way * sin(heading), heading)
        case Drive(forward=forward, yaw_rate=rate, duration=duration):
            end = yaw + rate * duration
            chord = forward * duration
            if abs(rate * duration) > 1e-6:
                chord = 2 * forward / rate * sin(rate * duration / 2)
            middle = (yaw + end) / 2
            return Pose(north + chord * cos(middle), east + chord * sin(middle), wrap(end))
        case _:
            return anchor


def _way(leg: Leg, left: float) -> float:
    """Return the metres of what is left of a leg."""
    match leg:
        case Move() | Follow():
            return left
        case Drive(forward=forward) | Head(forward=forward):
            return abs(forward) * left
        case Rotate() | Wait():
            return 0.0


def _seconds(leg: Leg, left: float, driving: Driving, speed: float) -> float:
    match leg:
        case Move(speed=own) | Follow(speed=own):
            return _ramped(left, own or speed, driving.acceleration)
        case Rotate(rate=rate):
            return _ramped(left, rate or driving.turn_rate, driving.turn_acceleration)
        case _:
            return left


def _ramped(way: float, top: float, acceleration: float) -> float:
    """Return the seconds for a distance with equal ramps up and down."""
    if way * acceleration < top * top:
        return 2 * sqrt(way / acceleration)
    return way / top + top / acceleration
