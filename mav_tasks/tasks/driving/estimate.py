"""Rough durations of tasks, for people who wait; and their ways, which limits of clients bound.

A goal is followed leg by leg from where the vehicle is. The estimate ignores other traffic,
corrections near the end, pauses, and a car's bends, but for those of the run that it drives.
"""

from dataclasses import replace
from math import nan
from typing import NamedTuple

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import GlobalPlace, GoTo, Pose, SingleGoal
from mav_tasks.kinds.base import WAY
from mav_tasks.tasks.driving.frames import local_place
from mav_tasks.tasks.driving.mission_sequencer import begun, following, is_over, present_goal
from mav_tasks.tasks.goal import Goal, Plan, SetSpeed
from mav_tasks.tasks.task import Progress

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
    speed = known.driving.speed
    if not isinstance(goal, Plan):
        return _time_of_goal(goal, progress, known, speed)
    progress = begun(goal, progress)
    speed = progress.speed or speed
    seconds, pose, metres = 0.0, known.pose, 0.0
    for _ in range(MOST_STEPS):
        for number in progress.pending:
            step = goal.steps[number]
            if isinstance(step, SetSpeed):
                speed = step.speed or known.driving.speed
        if is_over(goal, progress):
            return Estimate(seconds, pose, metres)
        present = present_goal(goal, progress)
        took, pose, way = _time_of_goal(present, progress, known._replace(pose=pose), speed)
        seconds += took
        metres += way
        after = following(goal, progress)
        if after is None or took != took:  # from an unknown place the rest is unknown, too
            break
        progress = after
    return UNKNOWN


def _time_of_goal(goal: SingleGoal, progress: Progress, known: Known, speed: float) -> Estimate:
    target = progress.target
    if target is None and isinstance(goal, GoTo):
        target = local_place(known.home if goal.place is None else goal.place, known.origin)
    pose = known.pose
    is_unknown = pose is None or (isinstance(goal, GoTo) and target is None)
    if is_unknown and progress.anchor is None and goal.is_absolute:
        return UNKNOWN
    at, seconds, metres, driving = pose or SOMEWHERE, SETTLING, 0.0, known.driving
    for number in range(progress.leg, goal.leg_count):
        if number == progress.leg and progress.anchor is not None:
            present, at = progress, progress.anchor
        else:
            at = goal.anchor_of(number, at, target)
            present = Progress(anchor=at, leg=number, target=target)
        leg = goal.leg_of(present)
        left = max(0.0, leg.length - present.done)
        took, way, at = leg.took(left, at, speed, driving)
        if number == WAY and target is not None:
            at = replace(at, north=target.north, east=target.east)
        seconds += took
        metres += way
    return Estimate(seconds, None if pose is None and progress.anchor is None else at, metres)
