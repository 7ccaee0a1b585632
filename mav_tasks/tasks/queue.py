"""The queue of one vehicle, and the order of tasks, which only this module decides.

A higher priority runs first; within a priority, first come, first served. Every ``aging`` seconds
of waiting count as one priority. All tasks age at the same rate, so that a static rank suffices: it
depends on when a task came, not on how long it has waited. Priority 10 is a class of its own; no
task ages into it.
"""

from bisect import bisect_left, insort
from collections.abc import Iterable
from typing import Any, NamedTuple

from mav_tasks.config.settings import Queueing
from mav_tasks.tasks.lifecycle import TaskState
from mav_tasks.tasks.task import MAX_PRIORITY, QueuePlace, Task, TaskId, Terms


class Rank(NamedTuple):
    """Sort key of a task: the smaller one runs first."""

    is_ordinary: bool  # not of the highest priority
    urgency: float
    came_at: float
    task_id: float  # of a task that was moved: between those of others
    priority: int


def rank_of(terms: Terms, *, came_at: float, task_id: float, aging: float) -> Rank:
    """Return a task's own rank; ``aging`` 0 for none.

    ``came_at``: since when it has competed with others, in monotonic seconds; this and its id do
    not count for a task that was moved.
    """
    priority = terms.priority
    if terms.place is not None:
        priority, came_at, task_id = terms.place.priority, terms.place.at, terms.place.task_id
    if priority == MAX_PRIORITY:
        return Rank(False, 0.0, came_at, task_id, priority)
    urgency = came_at - priority * aging if aging > 0 else -float(priority)
    return Rank(True, urgency, came_at, task_id, priority)


def outranks(waiting: Task, running: Task, *, queueing: Queueing) -> bool:
    """Return whether a waiting task may interrupt a running one.

    Only the submitted or modified terms count, not aging and not an inherited rank.
    """
    is_running = running.state in (TaskState.STARTING, TaskState.EXECUTING)
    if not is_running or not running.terms.is_preemptible:
        return False
    if waiting.terms.is_preemptive:
        return not running.terms.is_preemptive or waiting.priority > running.priority
    gap = queueing.preemption_gap
    return gap > 0 and waiting.priority - running.priority >= gap


#: sort key in the order of all tasks
_InOrder = tuple[Rank, TaskId]
#: sort key among the tasks that may interrupt
_ByPriority = tuple[int, Rank, TaskId]


class TaskQueue:
    """The ready tasks of one vehicle, in the order in which they will run.

    Plain sorted lists: nearly all tasks are appended, and shifting 100,000 takes some 20 µs.
    """

    def __init__(self) -> None:
        self._order: list[_InOrder] = []
        self._by_priority: list[_ByPriority] = []
        self._preemptive: list[_ByPriority] = []
        #: of each task: its rank, perhaps inherited from a dependent, and its terms
        self._entries: dict[TaskId, tuple[Rank, Terms]] = {}

    def __repr__(self) -> str:
        return f"TaskQueue({len(self)}, next={self.first()})"

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, task_id: TaskId) -> bool:
        return task_id in self._entries

    def _places(
        self, task_id: TaskId, rank: Rank, terms: Terms
    ) -> list[tuple[list[Any], tuple[Any, ...]]]:
        """Return the lists that a task belongs to, each with its item there."""
        by_priority = (-terms.priority, rank, task_id)
        places: list[tuple[list[Any], tuple[Any, ...]]] = [
            (self._order, (rank, task_id)),
            (self._by_priority, by_priority),
        ]
        if terms.is_preemptive:
            places.append((self._preemptive, by_priority))
        return places

    def put(self, task_id: TaskId, rank: Rank, terms: Terms) -> None:
        """Insert a task, or move it to its new place."""
        if task_id in self._entries:
            self.discard(task_id)
        self._entries[task_id] = rank, terms
        for ordered, item in self._places(task_id, rank, terms):
            if ordered and item < ordered[-1]:
                insort(ordered, item)
            else:  # nearly always
                ordered.append(item)

    def put_all(self, entries: Iterable[tuple[TaskId, Rank, Terms]]) -> None:
        """Insert many tasks; none of them may be in the queue yet."""
        for task_id, rank, terms in entries:
            self._entries[task_id] = rank, terms
            for ordered, item in self._places(task_id, rank, terms):
                ordered.append(item)
        for each in (self._order, self._by_priority, self._preemptive):
            each.sort()

    def discard(self, task_id: TaskId) -> None:
        """Remove a task if it is in the queue."""
        if entry := self._entries.pop(task_id, None):
            for ordered, item in self._places(task_id, *entry):
                del ordered[bisect_left(ordered, item)]

    def first(self) -> TaskId | None:
        """Return the task that runs next, or None."""
        return self._order[0][1] if self._order else None

    def interrupters(self) -> list[TaskId]:
        """Return the only tasks that may interrupt: the first pre-emptive one, and the first one.

        First by priority, then by rank: neither aging nor an inherited rank lets a lower priority
        interrupt.
        """
        return [first[0][2] for first in (self._preemptive[:1], self._by_priority[:1]) if first]

    def rank(self, task_id: TaskId) -> Rank:
        """Return the rank with which a task waits in the queue."""
        return self._entries[task_id][0]

    def position(self, task_id: TaskId) -> int | None:
        """Return how many queued tasks run before this one, or None if it is not queued."""
        entry = self._entries.get(task_id)
        return None if entry is None else bisect_left(self._order, (entry[0], task_id))

    def place_before(self, task_id: int) -> QueuePlace | None:
        """Return a place just before a task, 0: behind all; None: that task is not here."""
        at = self.position(TaskId(task_id)) if task_id else len(self)
        if at is None or not self._order:
            return None
        *before, rank = [each for each, _ in self._order[max(at - 1, 0) : at + 1]]
        beyond = rank.task_id + (-2 if task_id else 2)
        if before and before[0][:3] == rank[:3]:
            beyond = before[0].task_id
        return QueuePlace(rank.priority, rank.came_at, (beyond + rank.task_id) / 2)

    def page(self, first: int, count: int) -> list[TaskId]:
        """Return up to ``count`` tasks from the position ``first`` on."""
        return [task_id for _, task_id in self._order[first : first + count]]

    def in_order(self) -> list[TaskId]:
        """Return all tasks, next one first."""
        return self.page(0, len(self))
