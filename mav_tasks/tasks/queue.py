"""The order of waiting tasks: the one place that decides it, and the queue of one vehicle.

A higher priority runs first; within a priority, first come first served. Waiting makes a task more
urgent by one priority in every ``aging`` seconds, which a static rank expresses: what counts is not
how long each has waited so far but when each came. 10 is a class of its own, which nothing ages
into.
"""

from bisect import bisect_left, insort
from collections.abc import Iterable
from typing import Any, NamedTuple

from mav_tasks.errors import Rejection
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_PRIORITY, TaskId


class Rank(NamedTuple):
    """A place in the order: the smaller runs first."""

    is_ordinary: bool  # not of the highest priority
    urgency: float
    came_at: float
    task_id: int


def rank_of(priority: int, *, came_at: float, task_id: TaskId, aging: float) -> Rank:
    """Return a task's own rank; ``came_at`` in monotonic seconds, ``aging`` 0 for none."""
    if priority == MAX_PRIORITY:
        return Rank(False, 0.0, came_at, task_id)
    urgency = came_at - priority * aging if aging > 0 else -float(priority)
    return Rank(True, urgency, came_at, task_id)


class Entry(NamedTuple):
    """One task in the queue; ``rank`` may be another's, of a task that waits for this one."""

    task_id: TaskId
    rank: Rank
    priority: int = DEFAULT_PRIORITY
    is_preemptive: bool = False


#: where a task is in the order of all
_InOrder = tuple[Rank, TaskId]
#: where it is among those that may interrupt
_ByPriority = tuple[int, Rank, TaskId]


class TaskQueue:
    """The tasks of one vehicle that are ready, in the order in which they will run.

    In plain sorted lists: nearly all come at the end, and to move 100,000 on takes some 20 µs.
    """

    def __init__(self) -> None:
        self._order: list[_InOrder] = []
        self._by_priority: list[_ByPriority] = []
        self._preemptive: list[_ByPriority] = []
        self._entries: dict[TaskId, Entry] = {}

    def __repr__(self) -> str:
        return f"TaskQueue({len(self)}, next={self.first()})"

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, task_id: TaskId) -> bool:
        return task_id in self._entries

    def put(self, entry: Entry) -> None:
        """Put a task in its place, or in its new place."""
        task_id, rank, priority, is_preemptive = entry
        if task_id in self._entries:
            self.discard(task_id)
        self._entries[task_id] = entry
        insort(self._order, (rank, task_id))
        by_priority = (-priority, rank, task_id)
        insort(self._by_priority, by_priority)
        if is_preemptive:
            insort(self._preemptive, by_priority)

    def put_all(self, entries: Iterable[Entry]) -> None:
        """Put many tasks in, of which none is here yet."""
        for task_id, rank, priority, is_preemptive in (several := list(entries)):
            self._order.append((rank, task_id))
            self._by_priority.append((-priority, rank, task_id))
            if is_preemptive:
                self._preemptive.append((-priority, rank, task_id))
        self._entries.update((entry.task_id, entry) for entry in several)
        for each in (self._order, self._by_priority, self._preemptive):
            each.sort()

    def discard(self, task_id: TaskId) -> None:
        """Take a task out, if it is here."""
        entry = self._entries.pop(task_id, None)
        if entry is not None:
            by_priority = (-entry.priority, entry.rank, task_id)
            _remove(self._order, (entry.rank, task_id))
            _remove(self._by_priority, by_priority)
            if entry.is_preemptive:
                _remove(self._preemptive, by_priority)

    def first(self) -> TaskId | None:
        """Return the task that runs next."""
        return self._order[0][1] if self._order else None

    def interrupters(self) -> list[TaskId]:
        """Return the only tasks that may interrupt: the first pre-emptive one, and the first.

        By their own priority, and by their order within it: neither aging nor the urgency of
        others makes a task interrupt.
        """
        firsts = (self._preemptive[:1], self._by_priority[:1])
        return [first[0][2] for first in firsts if first]

    def rank(self, task_id: TaskId) -> Rank:
        """Return the rank by which a task waits here."""
        return self._entries[task_id].rank

    def position(self, task_id: TaskId) -> int | None:
        """Return how many tasks here run before this one, or None if it is not here."""
        entry = self._entries.get(task_id)
        return None if entry is None else bisect_left(self._order, (entry.rank, task_id))

    def page(self, first: int, count: int) -> list[TaskId]:
        """Return up to ``count`` tasks from the position ``first`` on."""
        return [task_id for _, task_id in self._order[first : first + count]]

    def in_order(self) -> list[TaskId]:
        """Return all tasks, next one first."""
        return self.page(0, len(self))


def _remove(ordered: list[Any], item: tuple[Any, ...]) -> None:
    """Take out of a sorted list what is in it."""
    del ordered[bisect_left(ordered, item)]


def full(capacity: int) -> Rejection:
    """Return the refusal of one task too many for a vehicle."""
    return Rejection(TaskReason.QUEUE_FULL, f"queue full: {capacity} tasks wait")
