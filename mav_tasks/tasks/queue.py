"""The bounded priority queue of one vehicle: the one place that orders tasks.

A higher priority runs first; within a priority, first come first served.
"""

from bisect import bisect_left, insort

from mav_tasks.errors import Rejection
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Task, TaskId

_Key = tuple[int, int]  # (-priority, task id): ids grow with the order of arrival


class TaskQueue:
    """Waiting tasks in the order in which they will run."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._keys: list[_Key] = []

    def __repr__(self) -> str:
        return f"TaskQueue({len(self._keys)}/{self.capacity}, next={self.first()})"

    def __len__(self) -> int:
        return len(self._keys)

    def add(self, task: Task) -> None:
        """Put a task in its place; Rejection(QUEUE_FULL) when there is none left."""
        self.check_room()
        insort(self._keys, _key(task))

    def check_room(self) -> None:
        """Raise Rejection(QUEUE_FULL) unless one more task fits."""
        if len(self._keys) >= self.capacity:
            raise Rejection(TaskReason.QUEUE_FULL, f"queue full: {self.capacity} tasks wait")

    def remove(self, task: Task) -> None:
        """Take a task out; KeyError if it is not waiting here."""
        index = self._index(task)
        if index is None:
            raise KeyError(task.id)
        del self._keys[index]

    def first(self) -> TaskId | None:
        """Give the task that runs next."""
        return TaskId(self._keys[0][1]) if self._keys else None

    def position(self, task: Task) -> int | None:
        """Give how many tasks run before this one, or None if it is not waiting here."""
        return self._index(task)

    def in_order(self) -> list[TaskId]:
        """Give all waiting tasks, next one first."""
        return [TaskId(task_id) for _, task_id in self._keys]

    def _index(self, task: Task) -> int | None:
        key = _key(task)
        index = bisect_left(self._keys, key)
        return index if self._keys[index : index + 1] == [key] else None


def _key(task: Task) -> _Key:
    return (-task.priority, task.id)
