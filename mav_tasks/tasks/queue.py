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
from mav_tasks.tasks.task import MAX_PRIORITY, TaskId


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


class TaskQueue:
    """The tasks of one vehicle that are ready, in the order in which they will run."""

    def __init__(self) -> None:
        self._order = SortedList()
        self._preemptive = SortedList()
        self._places: dict[TaskId, tuple[Rank, int]] = {}

    def __repr__(self) -> str:
        return f"TaskQueue({len(self)}, next={self.first()})"

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, task_id: TaskId) -> bool:
        return task_id in self._places

    def put(self, task_id: TaskId, rank: Rank, *, is_preemptive: bool = False) -> None:
        """Put a task in its place, or in its new place.

        ``rank`` may be another's, of a task that waits for this one.
        """
        self.discard(task_id)
        self._places[task_id] = (rank, task_id)
        self._order.add((rank, task_id))
        if is_preemptive:
            self._preemptive.add((rank, task_id))

    def put_all(self, tasks: Iterable[tuple[TaskId, Rank, bool]]) -> None:
        """Put many tasks in: id, rank, and whether it is pre-emptive; none of them is here yet."""
        places = [((rank, task_id), is_preemptive) for task_id, rank, is_preemptive in tasks]
        self._places.update((TaskId(place[1]), place) for place, _ in places)
        self._order.update(place for place, _ in places)
        self._preemptive.update(place for place, is_preemptive in places if is_preemptive)

    def discard(self, task_id: TaskId) -> None:
        """Take a task out, if it is here."""
        place = self._places.pop(task_id, None)
        if place is not None:
            self._order.remove(place)
            self._preemptive.discard(place)

    def first(self) -> TaskId | None:
        """Give the task that runs next."""
        return TaskId(self._order[0][1]) if self._order else None

    def first_preemptive(self) -> TaskId | None:
        """Give the first of those that may interrupt others."""
        return TaskId(self._preemptive[0][1]) if self._preemptive else None

    def rank(self, task_id: TaskId) -> Rank:
        """Give the rank by which a task waits here."""
        return self._places[task_id][0]

    def position(self, task_id: TaskId) -> int | None:
        """Give how many tasks here run before this one, or None if it is not here."""
        place = self._places.get(task_id)
        return None if place is None else int(self._order.index(place))

    def page(self, first: int, count: int) -> list[TaskId]:
        """Give up to ``count`` tasks from the position ``first`` on."""
        return [TaskId(task_id) for _, task_id in self._order[first : first + count]]

    def in_order(self) -> list[TaskId]:
        """Give all tasks, next one first."""
        return self.page(0, len(self))


def full(capacity: int) -> Rejection:
    """Give the refusal of one task too many for a vehicle."""
    return Rejection(TaskReason.QUEUE_FULL, f"queue full: {capacity} tasks wait")
