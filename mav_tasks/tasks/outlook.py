"""The outlook of a task for people: why it waits, its position, its times. It decides nothing."""

from collections import Counter
from collections.abc import Sequence
from math import nan

from mav_tasks.tasks.driving.estimate import time_left
from mav_tasks.tasks.forecast import Forecast, known_of
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R, S = TaskReason, TaskState


def position(tasks: VehicleTasks, task: Task) -> int | None:
    """Return how many tasks run before this one, or None if it is not ready to run."""
    ahead = tasks.queue.position(task.id)
    if ahead is None:
        return None
    return ahead + (tasks.active is not None) + len(tasks.suspended)


def estimate(
    tasks: VehicleTasks, task: Task, *, forecast: Forecast | None, now: float
) -> tuple[float, float]:
    """Return the estimated seconds until a task starts, and until it ends; NaN: not known.

    The end of a finished task is negative: so long ago. Without a ``forecast`` only two cheap
    estimates are made: the end of a running task, and both times of a scheduled one.
    """
    if task.state in (S.STARTING, S.EXECUTING):
        is_kept = task.state is S.STARTING and tasks.blocker_of(task.id)
        left = time_left(task.goal, task.progress, known_of(tasks)).seconds
        return 0.0, nan if is_kept else left
    if forecast is None:
        if task.state is not S.SCHEDULED:
            return nan, nan
        to_start = tasks.start_time(task) - now
        there = known_of(tasks)._replace(pose=None)  # where it will be by then is not known
        return to_start, to_start + time_left(task.goal, task.progress, there).seconds
    if task.state in TERMINAL:
        return nan, nan if task.changed_at is None else min(0.0, task.changed_at - now)
    return forecast.of(task)


def wait_reason(tasks: VehicleTasks, task: Task) -> TaskReason:
    """Return why a task is not being executed: what blocks it, or its own reason."""
    match task.state:
        case S.SCHEDULED:
            return R.START_TIME
        case S.BLOCKED:
            return R.WAITING_FOR_START if task.terms.is_staged else R.DEPENDENCY
        case S.QUEUED:
            return _why_queued(tasks, task)
        case S.HELD | S.STARTING:
            return tasks.blocker_of(task.id) or task.reason
        case _:
            return task.reason


def tally(tasks: VehicleTasks, counts: Sequence[int]) -> Counter[tuple[TaskState, TaskReason]]:
    """Return how many unfinished tasks of a vehicle have each state and reason.

    ``counts`` are its tasks by TaskState. The cost does not depend on how many wait: of the queued
    ones, all but the first wait for the same reason, and a blocked one counts as waiting for
    another task, although it may be staged.
    """
    found = Counter(
        {
            (S.SCHEDULED, R.START_TIME): counts[S.SCHEDULED],
            (S.BLOCKED, R.DEPENDENCY): counts[S.BLOCKED],
        }
    )
    for task_id, count in zip(tasks.queue.page(0, 2), (1, counts[S.QUEUED] - 1), strict=False):
        found[S.QUEUED, _why_queued(tasks, tasks.registry[task_id])] += count
    active = [] if tasks.active is None else [tasks.active]
    for task in (*active, *tasks.suspended):
        found[task.state, wait_reason(tasks, task)] += 1
    return +found


def _why_queued(tasks: VehicleTasks, task: Task) -> TaskReason:
    if tasks.is_held_ahead:
        return R.HELD_AHEAD
    if tasks.paused and task.id != tasks.immediate:
        return R.RESTARTED if tasks.paused is R.RESTARTED else R.QUEUE_PAUSED
    if tasks.stopping_after_kill:
        return R.STOP_UNCONFIRMED
    if tasks.executor.task_id is not None or tasks.queue.position(task.id):
        return R.BEHIND_OTHERS
    return tasks.blocker_of(task.id)
