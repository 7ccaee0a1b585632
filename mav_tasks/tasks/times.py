"""Start times and deadlines of waiting tasks, in monotonic time."""

from heapq import heapify, heappop, heappush
from math import inf

from mav_tasks.tasks.goal import Wait
from mav_tasks.tasks.task import Task, TaskId, Terms

DAY, HOUR, MINUTE = 86_400.0, 3_600.0, 60.0  # s
SPARE = 64  # outdated entries of a heap that do not matter
LATE = 1.0  # s that a clock may have been set back by


def waited(goal: Wait, done: float, *, utc: float) -> float:
    """Return how much of a wait is over; ``done`` is how much of it was when it was interrupted."""
    if not goal.until:
        return done
    hours, minutes, seconds = (max(part, 0) for part in goal.until)
    left = (hours * HOUR + minutes * MINUTE + seconds - utc) % goal.duration
    over = goal.duration - left
    return over if over >= done - LATE else goal.duration  # that time came meanwhile


class Schedule:
    """One time for each task. Its memory follows the number of tasks, and not that of changes."""

    def __init__(self) -> None:
        self._times: dict[TaskId, float] = {}
        self._heap: list[tuple[float, TaskId]] = []  # with outdated entries

    def __repr__(self) -> str:
        return f"{len(self._times)}"

    def put(self, task_id: TaskId, at: float | None) -> None:
        """Set a task's time in place of an earlier one; None or -inf: it has none."""
        if at is None or at == -inf:
            self._times.pop(task_id, None)
            return
        self._times[task_id] = at
        heappush(self._heap, (at, task_id))
        if len(self._heap) > 2 * len(self._times) + SPARE:
            self._heap = [(at, task_id) for task_id, at in self._times.items()]
            heapify(self._heap)

    def first(self) -> float:
        """Return the earliest time; inf without one."""
        while self._heap and self._times.get(self._heap[0][1]) != self._heap[0][0]:
            heappop(self._heap)
        return self._heap[0][0] if self._heap else inf

    def take(self, *, now: float) -> list[TaskId]:
        """Remove the times that have come, and return their tasks."""
        due: list[TaskId] = []
        while self.first() <= now:
            due.append(heappop(self._heap)[1])
            del self._times[due[-1]]
        return due


class Times:
    """The start times and deadlines of all waiting tasks."""

    def __init__(self) -> None:
        self.starts, self.deadlines = Schedule(), Schedule()
        #: UTC minus monotonic time, s; after a change ``note`` all waiting tasks again
        self.wall_offset = 0.0

    def __repr__(self) -> str:
        return f"Times({self.starts} starts, {self.deadlines} deadlines)"

    @property
    def next_at(self) -> float:
        """When the first entry is due; inf without one."""
        return min(self.starts.first(), self.deadlines.first())

    def start(self, terms: Terms) -> float:
        """Return the monotonic time before which a task does not start; -inf without one."""
        if terms.start_utc is None and terms.start_at is None:  # nearly always
            return -inf
        from_utc = -inf if terms.start_utc is None else terms.start_utc - self.wall_offset
        return max(from_utc, -inf if terms.start_at is None else terms.start_at)

    def deadline(self, terms: Terms) -> float | None:
        """Return the monotonic time until which a task must have started; None without one."""
        if terms.start_within is None:
            return terms.deadline
        return self.start(terms) + terms.start_within

    def is_too_late(self, task: Task, *, now: float) -> bool:
        """Return whether a waiting task's deadline has passed."""
        deadline = self.deadline(task.terms)
        return deadline is not None and deadline <= now

    def note(self, *tasks: Task) -> None:
        """Take the start times and deadlines of waiting tasks, in place of their earlier ones."""
        for task in tasks:
            self.starts.put(task.id, self.start(task.terms))
            self.deadlines.put(task.id, self.deadline(task.terms))

    def forget(self, task_id: TaskId) -> None:
        """Forget the times of a task that does not wait any more."""
        self.starts.put(task_id, None)
        self.deadlines.put(task_id, None)
