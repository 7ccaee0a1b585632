"""How long tasks take, roughly: for people who wait, never for a decision."""

from math import nan, sqrt

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import Leg
from mav_tasks.tasks.driving.legs import first_leg, leg_of, length_of
from mav_tasks.tasks.driving.path import Follow
from mav_tasks.tasks.goal import Goal, Move, Plan, Rotate
from mav_tasks.tasks.task import Progress

SETTLING = 1.5  # s from one task's end to motion, and from near its end to a measured standstill


def duration_of(goal: Goal, driving: Driving) -> float:
    """Give the seconds that a task takes from its start; NaN where its way is not known yet."""
    leg = None if isinstance(goal, Plan) else first_leg(goal)
    return nan if leg is None else SETTLING + _seconds(leg, length_of(leg), driving)


def time_left(goal: Goal, progress: Progress, driving: Driving) -> float:
    """Give the seconds that a begun task still takes."""
    if progress.anchor is None or isinstance(goal, Plan):
        return duration_of(goal, driving)
    leg = leg_of(goal, progress)
    left = max(0.0, length_of(leg) - progress.done)
    return SETTLING + _seconds(leg, left, driving)


def _seconds(leg: Leg, left: float, driving: Driving) -> float:
    match leg:
        case Move(speed=speed) | Follow(speed=speed):
            return _ramped(left, speed or driving.speed, driving.acceleration)
        case Rotate(rate=rate):
            return _ramped(left, rate or driving.turn_rate, driving.turn_acceleration)
        case _:
            return left


def _ramped(way: float, top: float, acceleration: float) -> float:
    """Seconds for a way with equal ramps up and down."""
    if way * acceleration < top * top:
        return 2 * sqrt(way / acceleration)
    return way / top + top / acceleration
