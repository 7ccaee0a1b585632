"""The ids of new tasks: counted by this server, or granted by the database of a fleet."""

from collections import deque
from collections.abc import Container

from mav_tasks.errors import Rejection
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import TaskId, following


class TaskIds:
    """Ids begin at 1 again after MAX_TASK_ID; the earlier tasks with these ids are long over."""

    def __init__(self, next_id: int = 1) -> None:
        self._next = next_id
        self._left = 0  # of the present range
        self._ranges: deque[tuple[int, int]] = deque()
        self._is_shared = False

    def __repr__(self) -> str:
        return f"TaskIds({self._next}, {self._ranges if self._is_shared else 'all'})"

    def count_from(self, next_id: int) -> None:
        """Continue with this id."""
        self._next = next_id

    def share(self) -> None:
        """Use granted ids only: other gateways give ids, too."""
        self._is_shared = True

    def grant(self, first: int, count: int) -> None:
        """Add ``count`` ids from ``first`` on."""
        self._ranges.append((first, count))

    def take(self, used: Container[int]) -> TaskId:
        """Return the next id that is not in use; raise Rejection if none is granted."""
        if not self._is_shared:
            self._next = self._free(self._next, used)
            return self._step()
        while True:
            if not self._left:
                if not self._ranges:
                    words = "the database has not granted a task id yet: not accepted"
                    raise Rejection(TaskReason.STORE_UNAVAILABLE, words)
                self._next, self._left = self._ranges.popleft()
            self._left -= 1
            task_id = self._step()
            if task_id not in used:
                return task_id

    def _step(self) -> TaskId:
        task_id = TaskId(self._next)
        self._next = following(task_id)
        return task_id

    @staticmethod
    def _free(task_id: int, used: Container[int]) -> int:
        while task_id in used:
            task_id = following(task_id)
        return task_id
