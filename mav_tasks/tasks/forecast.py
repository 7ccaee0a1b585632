"""The outlook of one vehicle's tasks for people: why they wait, positions, starts and ends.

It decides nothing. A forecast plays the queue through once: the best ready task runs, its end
unblocks others, start times come. It ignores pauses, pre-emption, tasks of other vehicles, and
aging. It serves one answer to a client, and computes nothing until it is asked.
"""

from collections import Counter
from collections.abc import Sequence
from heapq import heapify, heappop, heappush
from math import isnan, nan

from mav_tasks.tasks.driving.estimate import SETTLING, UNKNOWN, Estimate, Known, time_left
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.queue import Rank
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task, TaskId
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R, S = TaskReason, TaskState

FORESEEN = 500  # tasks; those behind them get no estimate
#: ready tasks up to which their end is computed for a decision, which holds up setpoints
FEW = 20

#: seconds until a task starts and until it ends; NaN: not known
Times = tuple[float, float]


class Forecast:
    """The starts and ends of one vehicle's tasks as of ``now``."""

    def __init__(self, tasks: VehicleTasks, registry: TaskRegistry, *, now: float) -> None:
        self._tasks = tasks
        self._registry = registry
        self._now = now
        self._played: tuple[dict[TaskId, Times], Estimate] | None = None  # not computed yet
        self._ready: list[tuple[Rank, TaskId]] = []
        self._due: list[tuple[float, TaskId]] = []  # seconds from now
        self._dependents: dict[int, list[Task]] = {}
        self._done = {tasks.executor.task_id}

    def __repr__(self) -> str:
        return f"Forecast({self._tasks.vehicle}, at {self._now})"

    def of(self, task: Task) -> Times:
        """Return the seconds until a waiting task starts, and until it ends; NaN: not known."""
        return self._outcome()[0].get(task.id, (nan, nan))

    def when_empty(self) -> Estimate:
        """Return in how many seconds, and where, all tasks are over that need not wait for a time.

        UNKNOWN if nothing can run, or there are too many.
        """
        return UNKNOWN if len(self._tasks.queue) > FEW else self._outcome()[1]

    def _outcome(self) -> tuple[dict[TaskId, Times], Estimate]:
        if self._played is None:
            self._played = self._play(known_of(self._tasks))
        return self._played

    def _play(self, known: Known) -> tuple[dict[TaskId, Times], Estimate]:
        """Return all times, and when no task is ready for the first time."""
        times: dict[TaskId, Times] = {}
        self._line_up(times)
        clock, pose, _ = self._when_free(known)
        empty = None if self._ready else Estimate(clock, pose)
        while not isnan(clock) and (self._ready or self._due) and len(times) < FORESEEN:
            if not self._ready:
                clock = max(clock, self._due[0][0])
            while self._due and self._due[0][0] <= clock:
                self._let_go(self._registry[heappop(self._due)[1]], clock)
            if not self._ready:
                continue
            task = self._registry[heappop(self._ready)[1]]
            seconds, pose, _ = time_left(task.goal, task.progress, known._replace(pose=pose))
            times[task.id] = (clock, clock + seconds)
            clock += seconds
            self._done.add(task.id)
            for dependent in self._dependents.pop(task.id, []):
                self._let_go(dependent, clock)
            if empty is None and not self._ready:
                empty = Estimate(clock, pose)
        return times, empty or UNKNOWN

    def _line_up(self, times: dict[TaskId, Times]) -> None:
        """Sort the waiting tasks into ready, due later, and dependent."""
        tasks = self._tasks
        self._ready = [(tasks.queue.rank(each), each) for each in tasks.queue.page(0, FORESEEN)]
        for suspended in tasks.suspended:
            if suspended.state is S.PAUSED:
                self._ready.append((tasks.room.rank(suspended), suspended.id))
        heapify(self._ready)
        if tasks.room.count(tasks.vehicle) == len(tasks.queue):
            return
        for task_id in tasks.waiting[len(tasks.queue) :][:FORESEEN]:
            task = self._registry[task_id]
            if task.state is S.SCHEDULED:
                due = tasks.start_time(task) - self._now
                times[task_id] = (due, nan)  # the earliest; other tasks may delay it
                heappush(self._due, (due, task_id))
            else:
                self._let_go(task, 0.0)

    def _let_go(self, task: Task, clock: float) -> None:
        """Put a task that waits for no other one among the ready ones, or those due later."""
        due = self._tasks.start_time(task) - self._now
        if due > clock:
            heappush(self._due, (due, task.id))
        elif not task.terms.is_staged and not self._is_blocked(task):
            heappush(self._ready, (self._tasks.room.rank(task), task.id))

    def _is_blocked(self, task: Task) -> bool:
        """Return whether a due task waits for another one, and note the dependency."""
        if self._tasks.room.is_expecting(task):
            return True
        ahead = self._registry.get(task.terms.after) if task.terms.after else None
        if ahead is None or ahead.state in TERMINAL or ahead.id in self._done:
            return False
        self._dependents.setdefault(ahead.id, []).append(task)
        return True

    def _when_free(self, known: Known) -> Estimate:
        """Return when and where the vehicle is free for a task; UNKNOWN if nothing can run."""
        tasks = self._tasks
        is_up = tasks.seen is not None and tasks.seen.heard
        if tasks.paused or tasks.is_held_ahead or tasks.stopping_after_kill or not is_up:
            return UNKNOWN
        active = tasks.active
        if active is None:
            first = tasks.queue.first()
            blocked = first is not None and tasks.blocker_of(first)
            return UNKNOWN if blocked else Estimate(0.0, known.pose)
        if active.state is S.CANCELLING:
            return Estimate(SETTLING, known.pose)
        if active.state not in (S.STARTING, S.EXECUTING) or tasks.blocker_of(active.id):
            return UNKNOWN
        return time_left(active.goal, active.progress, known)


def known_of(tasks: VehicleTasks) -> Known:
    """Return the inputs for an estimate of a vehicle's tasks."""
    seen = tasks.seen
    if seen is None:
        return Known(tasks.driving)
    pose = None if seen.motion is None else seen.motion.pose
    return Known(tasks.driving, pose, seen.home, seen.origin)


def known_when_empty(tasks: VehicleTasks, registry: TaskRegistry, *, now: float) -> Known:
    """Return from where a new task is driven: where those before it end, else from here."""
    known = known_of(tasks)
    return known._replace(pose=Forecast(tasks, registry, now=now).when_empty().pose or known.pose)


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
            if tasks.is_held_ahead:
                return R.HELD_AHEAD
            if tasks.paused and task.id != tasks.immediate:
                return R.RESTARTED if tasks.paused is R.RESTARTED else R.QUEUE_PAUSED
            if tasks.stopping_after_kill:
                return R.STOP_UNCONFIRMED
            if tasks.executor.task_id is not None or tasks.queue.position(task.id):
                return R.BEHIND_OTHERS
            return tasks.blocker_of(task.id)
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
        found[S.QUEUED, wait_reason(tasks, tasks.registry[task_id])] += count
    for task in tasks.begun:
        found[task.state, wait_reason(tasks, task)] += 1
    return +found
