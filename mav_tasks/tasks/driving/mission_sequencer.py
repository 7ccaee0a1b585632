"""Sequences a plan's steps: which one is driven next, and which are done on the way. Pure.

Steps that drive follow one another. Steps between two of them (speeds, commands, conditions) belong
to the way to the second one, as in autopilots: they are ``pending`` when it begins, and are done
while it is driven.
"""

from collections.abc import Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from math import inf
from typing import NamedTuple

from mav_tasks.kinds import GoTo, LocalPlace, SingleGoal, Wait
from mav_tasks.tasks.goal import (
    Delay,
    Goal,
    Jump,
    Near,
    OnTheWay,
    Perform,
    Plan,
    SetReverse,
    SetSpeed,
    Step,
    steps_of,
)
from mav_tasks.tasks.task import Progress, Task

END = Wait(0.0)  # past the last step: pending steps are still done


class Looked(NamedTuple):
    """The steps on the way that one look has done."""

    progress: Progress
    done: tuple[int, ...]
    performs: bool  # whether the last of them is a command to the vehicle


def has_local_place(goal: Goal) -> bool:
    """Return whether a goal has a place in local coordinates, which no other frame shares."""
    places = (step.place for step in steps_of(goal) if isinstance(step, GoTo))
    return any(isinstance(place, LocalPlace) for place in places)


def present_goal(goal: Goal, progress: Progress) -> SingleGoal:
    """Return the goal that is being driven, or that will be first."""
    if not isinstance(goal, Plan):
        return goal
    progress = begun(goal, progress)
    driven = _driven(goal, progress.step) or END
    if progress.backwards and isinstance(driven, GoTo) and driven.place and not driven.turns:
        return replace(driven, backwards=True)  # a return and a circle are driven forwards
    return driven


def goal_of(task: Task) -> SingleGoal:
    """Return the goal that a task is driving, or will drive first."""
    return present_goal(task.goal, task.progress)


def started(plan: Plan, progress: Progress) -> Progress:
    """Return the progress with which a plan starts."""
    return skipped_to(plan, replace(progress, jumps=(), speed=None, backwards=False), plan.first)


def begun(goal: Goal, progress: Progress) -> Progress:
    """Return the progress of a goal that has started, which a plan does with its first step."""
    if isinstance(goal, Plan) and progress.step < 0:
        return started(goal, progress)
    return progress


def following(plan: Plan, progress: Progress) -> Progress | None:
    """Return the progress with which the next step begins; None if the plan is over."""
    return None if is_over(plan, progress) else skipped_to(plan, progress, progress.step + 1)


def is_over(plan: Plan, progress: Progress) -> bool:
    """Return whether no step is left to drive."""
    return progress.step >= len(plan.steps)


def goes_on_to_a_place(plan: Plan, progress: Progress) -> GoTo | None:
    """Return the next step that drives, if it goes to a place in the same direction, or None."""
    after = following(plan, progress)
    goal = None if after is None or is_over(plan, after) else present_goal(plan, after)
    before = present_goal(plan, progress)
    if not isinstance(goal, GoTo) or not isinstance(before, GoTo) or goal.turns:
        return None
    return goal if goal.backwards == before.backwards else None


def loops_in_vain(plan: Plan) -> int | None:
    """Return the jump that closes a loop in which nothing is driven, or None.

    It assumes that every jump may be taken, or not taken, at any time.
    """
    goals = ((step, _driven(plan, step)) for step in range(len(plan.steps)))
    instant = (step for step, goal in goals if goal is None or goal.is_instant)
    ways = {step: ways_on(plan.steps, step) for step in instant}
    try:
        TopologicalSorter(ways).prepare()
    except CycleError as why:
        loop: list[int] = why.args[1]
        return max(loop)
    return None


def look_on_the_way(
    plan: Plan, progress: Progress, *, to_place: float | None, elapsed: float
) -> Looked:
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
    return Looked(progress, tuple(done), performs)


def ways_on(steps: Sequence[Step], step: int) -> list[int]:
    """Return the steps that may follow another, whichever jumps are taken."""
    present = steps[step]
    return [step + 1, present.to] if isinstance(present, Jump) else [step + 1]


def _driven(plan: Plan, step: int) -> SingleGoal | None:
    goal = plan.steps[step] if 0 <= step < len(plan.steps) else None
    return goal if isinstance(goal, SingleGoal) else None


def skipped_to(plan: Plan, progress: Progress, step: int) -> Progress:
    """Return the progress at a step, or at the next one that drives, or past the end."""
    made = dict(zip(progress.jumps[::2], progress.jumps[1::2], strict=True))
    pending = dict.fromkeys(progress.pending)  # each once, or a loop would add ever more
    backwards = progress.backwards
    while 0 <= step < len(plan.steps):  # it ends: no plan loops in vain
        present = plan.steps[step]
        if isinstance(present, Jump):
            count = made.get(step, 0)
            if present.times < 0 or count < present.times:
                made[step] = count + 1
                step = present.to
                continue
        elif isinstance(present, OnTheWay):
            pending[step] = None
        elif isinstance(present, SetReverse):
            backwards = present.backwards
        elif isinstance(present, SingleGoal):
            break
        step += 1
    jumps = tuple(number for pair in made.items() for number in pair)
    return replace(
        progress,
        step=step,
        jumps=jumps,
        pending=tuple(pending),
        pending_for=progress.pending_for if progress.pending else 0.0,
        leg=0,
        anchor=None,
        target=None,
        done=0.0,
        path=(),
        backwards=backwards,
    )
