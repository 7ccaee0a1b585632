"""Start times and deadlines of waiting tasks, in monotonic time."""

from heapq import heapify, heappop, heappush
from math import inf

from mav_tasks.tasks.task import Task, TaskId, Terms

SPARE = 64  # outdated entries of the heap that do not matter
UNTIMED = (None, None, None, None)


class Times:
    """When something is due for each waiting task: its start, then its deadline.

    Their memory follows the number of tasks, and not that of changes.
    """

    def __init__(self) -> None:
        self._due: dict[TaskId, float] = {}
        self._heap: list[tuple[float, TaskId]] = []  # with outdated entries, but not at its top
        #: when the first entry is due; inf without one
        self.next_at = inf
        #: UTC minus monotonic time, s; after a change ``note`` all waiting tasks again
        self.wall_offset = 0.0

    def __repr__(self) -> str:
        return f"Times({len(self._due)} due)"

    def start(self, terms: Terms) -> float:
        """Return the monotonic time before which a task does not start; -inf without one."""
        if terms.start_utc is None and terms.start_at is None:  # nearly always
            return -inf
        from_utc = -inf if terms.start_utc is None else terms.start_utc - self.wall_offset
        return max(from_utc, -inf if terms.start_at is None else terms.start_at)

    def deadline(self, terms: Terms) -> float:
        """Return the monotonic time until which a task must have started; inf without one."""
        if terms.start_within is not None:
            return self.start(terms) + terms.start_within
        return inf if terms.deadline is None else terms.deadline

    def is_too_late(self, task: Task, *, now: float) -> bool:
        """Return whether a waiting task's deadline has passed."""
        return self.deadline(task.terms) <= now

    def note(self, task: Task) -> None:
        """Take a waiting task's start time and deadline, in place of earlier ones."""
        terms = task.terms
        if (terms.start_at, terms.start_utc, terms.start_within, terms.deadline) != UNTIMED:
            start, deadline = self.start(terms), self.deadline(terms)
            self._put(task.id, deadline if start == -inf else min(start, deadline))
        elif task.id in self._due:
            self.forget(task.id)

    def forget(self, task_id: TaskId) -> None:
        """Forget the times of a task that does not wait any more."""
        if self._due.pop(task_id, None) == self.next_at:
            self._look()

    def take(self, *, now: float) -> list[TaskId]:
        """Return the tasks whose start or deadline has come, and remove that time."""
        due: list[TaskId] = []
        while self.next_at <= now:
            due.append(self._heap[0][1])
            self.forget(due[-1])
        return due

    def started(self, task: Task) -> None:
        """Take that a task's start time has come; its deadline has not."""
        self._put(task.id, self.deadline(task.terms))

    def _put(self, task_id: TaskId, at: float) -> None:
        if at == inf:
            self.forget(task_id)
            return
        self._due[task_id] = at
        heappush(self._heap, (at, task_id))
        if len(self._heap) > 2 * len(self._due) + SPARE:
            self._heap = [(at, task_id) for task_id, at in self._due.items()]
            heapify(self._heap)
        self._look()

    def _look(self) -> None:
        """Drop outdated entries, and note when the first one is due."""
        heap = self._heap
        while heap and self._due.get(heap[0][1]) != heap[0][0]:
            heappop(heap)
        self.next_at = heap[0][0] if heap else inf
