"""Start times and deadlines of waiting tasks, in monotonic time."""

from collections.abc import Container, Iterable
from heapq import heapify, heappop, heappush
from math import inf

from mav_tasks.tasks.task import Task, TaskId, Terms


class Times:
    """Heaps of start times and deadlines. Outdated entries stay until due; callers skip them."""

    def __init__(self) -> None:
        self._starts: list[tuple[float, TaskId]] = []
        self._deadlines: list[tuple[float, TaskId]] = []
        self._wall_offset = 0.0
        #: when the first entry is due; inf without one
        self.next_at = inf

    def __repr__(self) -> str:
        return f"Times({len(self._starts)} starts, {len(self._deadlines)} deadlines)"

    def start(self, terms: Terms) -> float:
        """Return the monotonic time before which a task does not start; -inf without one."""
        if terms.start_utc is None and terms.start_at is None:  # nearly always
            return -inf
        from_utc = -inf if terms.start_utc is None else terms.start_utc - self._wall_offset
        return max(from_utc, -inf if terms.start_at is None else terms.start_at)

    @property
    def wall_offset(self) -> float:
        """UTC minus monotonic time, s."""
        return self._wall_offset

    def deadline(self, terms: Terms) -> float | None:
        """Return the monotonic time until which a task must have started; None without one."""
        if terms.start_within is None:
            return terms.deadline
        return self.start(terms) + terms.start_within

    def is_too_late(self, task: Task, *, now: float) -> bool:
        """Return whether a waiting task's deadline has passed."""
        deadline = self.deadline(task.terms)
        return deadline is not None and deadline <= now

    def note(self, task: Task) -> None:
        """Add the start time and the deadline of a waiting task."""
        terms = task.terms
        if terms.start_utc is not None or terms.start_at is not None:
            heappush(self._starts, (self.start(terms), task.id))
            self._look()
        deadline = self.deadline(terms)
        if deadline is not None:
            heappush(self._deadlines, (deadline, task.id))
            self._look()

    def forget(self, tasks: Container[TaskId]) -> None:
        """Forget the times of these tasks."""
        for heap in (self._starts, self._deadlines):
            heap[:] = [entry for entry in heap if entry[1] not in tasks]
            heapify(heap)
        self._look()

    def _look(self) -> None:
        first_start = self._starts[0][0] if self._starts else inf
        self.next_at = min(first_start, self._deadlines[0][0] if self._deadlines else inf)

    def take_over(self, *, now: float) -> list[tuple[float, TaskId]]:
        """Remove and return the deadlines that have passed, with their tasks."""
        return self._take(self._deadlines, now)

    def take_starts(self, *, now: float) -> list[tuple[float, TaskId]]:
        """Remove and return the start times that have come, with their tasks."""
        return self._take(self._starts, now)

    def _take(self, heap: list[tuple[float, TaskId]], now: float) -> list[tuple[float, TaskId]]:
        due: list[tuple[float, TaskId]] = []
        while heap and heap[0][0] <= now:
            due.append(heappop(heap))
        self._look()
        return due

    def set_wall_offset(self, offset: float, tasks: Iterable[Task]) -> None:
        """Set UTC minus monotonic time, s, and rebuild the times of all waiting tasks."""
        self._wall_offset = offset
        tasks = list(tasks)
        deadlines = [(self.deadline(task.terms), task.id) for task in tasks]
        self._deadlines = [(at, task_id) for at, task_id in deadlines if at is not None]
        heapify(self._deadlines)
        starts = [(self.start(task.terms), task.id) for task in tasks]
        self._starts = [(due, task_id) for due, task_id in starts if due > -inf]
        heapify(self._starts)
        self._look()
