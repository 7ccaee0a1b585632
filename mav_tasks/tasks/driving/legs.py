"""Begins the legs of a goal; the kinds say which these are."""

from dataclasses import replace

from mav_tasks.kinds import Pose, SingleGoal
from mav_tasks.tasks.task import Progress


def begun_leg(goal: SingleGoal, progress: Progress, leg: int, pose: Pose) -> Progress:
    """Return the progress with which a leg begins at a pose."""
    anchor = goal.anchor_of(leg, pose, progress.target)
    return replace(progress, leg=leg, anchor=anchor, done=0.0, path=())
