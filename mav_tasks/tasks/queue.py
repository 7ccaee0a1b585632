"""The order of waiting tasks: the one place that decides it, and the queue of one vehicle.

A higher priority runs first; within a priority, first come first served. Waiting makes a task more
urgent by one priority in every ``aging`` seconds, which a static rank expresses: what counts is not
how long each has waited so far but when each came. 10 is a class of its own, which nothing ages
into.
"""

from collections.abc import Iterable
from typing import NamedTuple

from sortedcontainers import SortedList

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
    """Give a task's own rank; ``came_at`` in monotonic seconds, ``aging`` 0 for none."""
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


class _Place(NamedTuple):
    """Where a task is in the sorted lists."""

    in_order: tuple[Rank, int]
    by_priority: tuple[int, tuple[Rank, int]]


def _place_of(entry: Entry) -> _Place:
    in_order = entry.rank, entry.task_id
    return _Place(in_order, (-entry.priority, in_order))


class TaskQueue:
    """The tasks of one vehicle that are ready, in the order in which they will run."""

    def __init__(self) -> None:
        self._order = SortedList()
        self._by_priority = SortedList()
        self._preemptive = SortedList()
        self._places: dict[TaskId, _Place] = {}

    def __repr__(self) -> str:
        return f"TaskQueue({len(self)}, next={self.first()})"

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, task_id: TaskId) -> bool:
        return task_id in self._places

    def put(self, entry: Entry) -> None:
        """Put a task in its place, or in its new place."""
        self.discard(entry.task_id)
        place = _place_of(entry)
        self._places[entry.task_id] = place
        self._order.add(place.in_order)
        self._by_priority.add(place.by_priority)
        if entry.is_preemptive:
            self._preemptive.add(place.by_priority)

    def put_all(self, entries: Iterable[Entry]) -> None:
        """Put many tasks in, of which none is here yet."""
        places = {entry: _place_of(entry) for entry in entries}
        self._places.update((entry.task_id, place) for entry, place in places.items())
        self._order.update(place.in_order for place in places.values())
        self._by_priority.update(place.by_priority for place in places.values())
        self._preemptive.update(p.by_priority for e, p in places.items() if e.is_preemptive)

    def discard(self, task_id: TaskId) -> None:
        """Take a task out, if it is here."""
        place = self._places.pop(task_id, None)
        if place is not None:
            self._order.remove(place.in_order)
            self._by_priority.remove(place.by_priority)
            self._preemptive.discard(place.by_priority)

    def first(self) -> TaskId | None:
        """Give the task that runs next."""
        return TaskId(self._order[0][1]) if self._order else None

    def interrupters(self) -> list[TaskId]:
        """Give the tasks that may interrupt if any here may: the first marked so, the first of all.

        By their own priority, and by their order within it: neither aging nor the urgency of
        others makes a task interrupt.
        """
        firsts = (self._preemptive[:1], self._by_priority[:1])
        return [TaskId(first[0][1][1]) for first in firsts if first]

    def rank(self, task_id: TaskId) -> Rank:
        """Give the rank by which a task waits here."""
        return self._places[task_id].in_order[0]

    def position(self, task_id: TaskId) -> int | None:
        """Give how many tasks here run before this one, or None if it is not here."""
        place = self._places.get(task_id)
        return None if place is None else int(self._order.index(place.in_order))

    def page(self, first: int, count: int) -> list[TaskId]:
        """Give up to ``count`` tasks from the position ``first`` on."""
        return [TaskId(task_id) for _, task_id in self._order[first : first + count]]

    def in_order(self) -> list[TaskId]:
        """Give all tasks, next one first."""
        return self.page(0, len(self))


def full(capacity: int) -> Rejection:
    """Give the refusal of one task too many for a vehicle."""
    return Rejection(TaskReason.QUEUE_FULL, f"queue full: {capacity} tasks wait")
