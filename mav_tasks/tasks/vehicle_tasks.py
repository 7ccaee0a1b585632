"""The tasks of one vehicle: its queue, the begun one, and what makes the queue stand.

The STOP latch is the queue's pause reason STOPPED: there is no second flag. Nothing here knows how
a vehicle is spoken to; ``step`` says what it must be made to do.
"""

from dataclasses import replace

from mav_tasks.errors import Rejection
from mav_tasks.settings import Settings
from mav_tasks.tasks import view
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.events import SERVER, QueueContinued, QueuePaused, TaskWaits
from mav_tasks.tasks.executor import Executor
from mav_tasks.tasks.lifecycle import WAITING, TaskReason, TaskState, words_of
from mav_tasks.tasks.queue import TaskQueue
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.task import Draft, Task, TaskId
from mav_tasks.tasks.view import Demand, VehicleView

R = TaskReason


class VehicleTasks:
    """Queue and begun task of the vehicle with this system id."""

    def __init__(self, vehicle: int, book: TaskBook, settings: Settings) -> None:
        self.vehicle = vehicle
        self._book = book
        self._settings = settings
        self._queue = TaskQueue(settings.queueing.capacity)
        self._executor = Executor(book, settings)
        self._paused = TaskReason.NONE
        self._blocker = TaskReason.NONE  # why the next task does not begin
        self._blocked: TaskId | None = None  # which task that was

    def __repr__(self) -> str:
        return f"VehicleTasks({self.vehicle}, {self._queue!r}, {self._paused.name}, {self.begun!r})"

    @property
    def begun(self) -> Task | None:
        """The one task that is begun and not over."""
        return self._executor.task

    @property
    def paused(self) -> TaskReason:
        """Why the queue stands, or NONE."""
        return self._paused

    @property
    def is_stopped(self) -> bool:
        """Whether STOP is latched."""
        return self._paused is TaskReason.STOPPED

    @property
    def waiting(self) -> list[TaskId]:
        """Waiting tasks, next one first."""
        return self._queue.in_order()

    @property
    def capacity(self) -> int:
        """How many tasks may wait."""
        return self._queue.capacity

    @property
    def is_idle(self) -> bool:
        """Whether there is neither a begun nor a waiting task."""
        return self.begun is None and len(self._queue) == 0

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        self._queue.capacity = settings.queueing.capacity
        self._executor.apply(settings)

    @property
    def awaits_commit(self) -> bool:
        """Whether the next task waits for nothing but its submission being durable."""
        first = self._queue.first()
        return first is not None and self.begun is None and not self._book.is_durable(first)

    def position(self, task: Task) -> int | None:
        """Give how many tasks run before this one, or None if it does not wait."""
        ahead = self._queue.position(task)
        if ahead is None:
            return None
        return ahead + (self.begun is not None)

    def wait_reason(self, task: Task) -> TaskReason:
        """Give why a task is not being executed; its own reason once it has begun."""
        if task.state not in WAITING:
            return task.reason
        if self._paused:
            return R.QUEUE_PAUSED
        begun = self.begun
        if begun is not None:
            return R.HELD_AHEAD if begun.state is TaskState.HELD else R.BEHIND_OTHERS
        return R.BEHIND_OTHERS if self._queue.position(task) else self._blocker

    def submit(self, draft: Draft, *, now: float) -> Task:
        """Queue a task; Rejection(QUEUE_FULL) when too many wait."""
        self._queue.check_room()
        task = self._book.submit(draft, now=now)
        self._queue.add(task)
        return task

    def withdraw(self, task: Task, *, now: float) -> None:
        """Take back a submission that did not become durable; it cannot have left the queue."""
        self._queue.remove(task)
        self._book.withdraw(task.id, now=now)

    def pause(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """Let the begun task and the queue stand; gives the task's id. Never undoes a STOP."""
        self._executor.pause(reason, actor=actor, now=now)
        self._pause_queue(reason, actor=actor, now=now)
        begun = self.begun
        return None if begun is None else begun.id

    def proceed(self, seen: VehicleView, *, actor: str, now: float) -> TaskId | None:
        """Release the STOP latch or any other pause; gives the task that goes on, if one does.

        A task that could not take the vehicle now is not resumed: Rejection says what is in its
        way, and everything stays as it is.
        """
        begun = self.begun
        resumes = begun is not None and begun.state is TaskState.PAUSED
        if resumes:
            blocker = start_blocker(seen, watch=self._settings.watch, now=now)
            if blocker:
                raise Rejection(blocker, f"cannot continue: {words_of(blocker)}")
        elif begun is not None and begun.state is TaskState.HELD:
            words = f"task {begun.id} is held ({words_of(begun.reason)}): STOP ends it"
            raise Rejection(R.WRONG_STATE, words)
        if self._paused:
            self._paused = R.NONE
            self._book.record(QueueContinued(self.vehicle, actor, now))
        if resumes:
            self._executor.resume(seen, actor=actor, now=now)
        begun = self.begun
        return None if begun is None or begun.state is TaskState.HELD else begun.id

    def hold(self, reason: TaskReason, *, now: float) -> None:
        """Set the begun task aside until somebody decides what becomes of it."""
        self._executor.hold(reason, now=now)

    def stop(self, *, clear: bool, actor: str, now: float) -> TaskId | None:
        """Kill the begun task and latch; with ``clear`` the waiting ones are cancelled too."""
        killed = self._executor.kill(R.STOP, actor=actor, now=now)
        self._pause_queue(R.STOPPED, actor=actor, now=now)
        if clear:
            for task_id in self._queue.in_order():
                self._queue.remove(self._book[task_id])
                self._book.change(
                    task_id, TaskState.CANCELLED, reason=R.CLEARED, actor=actor, now=now
                )
        return killed

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Begin what can begin, and give what the vehicle must be made to do now."""
        if self.is_stopped:
            return view.STOP
        before = self.begun
        demand = self._executor.step(seen, now=now)
        if before is not None and self.begun is None:
            self._after_end(self._book[before.id], now=now)
        if self.begun is not None:
            return demand
        self._begin_next(seen, now=now)
        if self.begun is not None:  # what was refused was refused to the one before
            return self._executor.step(replace(seen, refusal=R.NONE), now=now)
        return view.HAND_BACK if self.is_idle else view.HOLD

    def _begin_next(self, seen: VehicleView, *, now: float) -> None:
        first = self._queue.first()
        if first is None or self._paused:
            return
        self._note_blocker(first, start_blocker(seen, watch=self._settings.watch, now=now), now=now)
        if self._blocker or not self._book.is_durable(first):
            return
        task = self._book[first]
        self._queue.remove(task)
        self._executor.begin(task, actor=SERVER, now=now)

    def _note_blocker(self, first: TaskId, blocker: TaskReason, *, now: float) -> None:
        """Keep why the next task does not begin, and tell of it once each time that it changes."""
        if blocker and (first, blocker) != (self._blocked, self._blocker):
            self._book.record(TaskWaits(first, self.vehicle, blocker, now))
        self._blocked, self._blocker = first, blocker

    def _after_end(self, task: Task, *, now: float) -> None:
        """After a failure that had moved the vehicle, somebody should look before the next."""
        moved = task.progress.anchor is not None
        if task.state is TaskState.FAILED and moved and self._settings.on_failure == "pause":
            self._pause_queue(task.reason, actor=SERVER, now=now)

    def _pause_queue(self, reason: TaskReason, *, actor: str, now: float) -> None:
        if self._paused in (reason, R.STOPPED):
            return
        self._paused = reason
        self._book.record(QueuePaused(self.vehicle, reason, actor, now))
