"""What people ask about a task: why it waits, behind how many, how long. It decides nothing."""

from math import nan

from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.driving.estimate import duration_of, time_left
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R, S = TaskReason, TaskState

FORESEEN = 500  # tasks ahead, beyond which nobody reckons when a task starts


def position(tasks: VehicleTasks, task: Task) -> int | None:
    """Give how many tasks run before this one, or None if it is not ready to run."""
    ahead = tasks.queue.position(task.id)
    if ahead is None:
        return None
    return ahead + (tasks.begun is not None) + len(tasks.aside)


def estimate(tasks: VehicleTasks, task: Task, book: TaskBook, *, now: float) -> tuple[float, float]:
    """Give the estimated seconds until a task starts, and until it ends; NaN: not known."""
    match task.state:
        case S.STARTING | S.EXECUTING:
            return 0.0, time_left(task.goal, task.progress, tasks.terms.driving)
        case S.SCHEDULED:
            to_start = tasks.start_time(task) - now
        case S.QUEUED:
            to_start = _time_ahead(tasks, task, book)
        case _:
            return nan, nan
    return to_start, to_start + duration_of(task.goal, tasks.terms.driving)


def _time_ahead(tasks: VehicleTasks, task: Task, book: TaskBook) -> float:
    """Give the seconds until those before it are done; NaN while nothing goes on."""
    place = tasks.queue.position(task.id)
    if tasks.paused or tasks.is_held_ahead or place is None or place > FORESEEN:
        return nan
    ahead = [book[task_id] for task_id in tasks.queue.page(0, place)]
    begun = [task for task in (tasks.begun, *tasks.aside) if task is not None]
    return sum(time_left(t.goal, t.progress, tasks.terms.driving) for t in (*begun, *ahead))


def wait_reason(tasks: VehicleTasks, task: Task) -> TaskReason:
    """Give why a task is not being executed; its own reason once it has begun."""
    match task.state:
        case S.SCHEDULED:
            return R.START_TIME
        case S.BLOCKED:
            return R.WAITING_FOR_START if task.terms.is_staged else R.DEPENDENCY
        case S.QUEUED:
            return _why_queued(tasks, task)
        case S.HELD | S.STARTING:
            return tasks.turns.blocker_of(task.id) or task.reason
        case _:
            return task.reason


def _why_queued(tasks: VehicleTasks, task: Task) -> TaskReason:
    if tasks.is_held_ahead:
        return R.HELD_AHEAD
    if tasks.paused and task.id != tasks.urgent:
        return R.RESTARTED if tasks.paused is R.RESTARTED else R.QUEUE_PAUSED
    if tasks.is_halting:
        return R.STOP_UNCONFIRMED
    if tasks.executor.task_id is not None or tasks.queue.position(task.id):
        return R.BEHIND_OTHERS
    return tasks.turns.blocker_of(task.id)
