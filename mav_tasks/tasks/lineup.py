"""The tasks of one vehicle as they stand: its queue, those begun, and what makes the queue stand.

The STOP latch is the queue's pause reason STOPPED: there is no second flag. One task at a time has
the vehicle; others may have begun and be set aside: pre-empted, or held.
"""

from dataclasses import dataclass

from mav_tasks.errors import Rejection
from mav_tasks.settings import SET_FAILSAFE, Settings
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.displacement import LedAway
from mav_tasks.tasks.events import QueuePaused, VehicleHalted
from mav_tasks.tasks.executor import Executor
from mav_tasks.tasks.goal import SingleGoal
from mav_tasks.tasks.halts import Halts
from mav_tasks.tasks.lifecycle import TAKEN, WAITING, TaskReason, TaskState, words_of
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.queue import TaskQueue
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.task import Task, TaskId, same_frame
from mav_tasks.tasks.timing import Timing
from mav_tasks.tasks.vehicle_terms import VehicleTerms
from mav_tasks.tasks.view import VehicleView

R, S = TaskReason, TaskState

#: what the person who reads a refusal may do about it
WAYS_OUT = {
    R.WRONG_MODE: "wrong mode, set HOLD first",
    R.DISARMED: "disarmed; continue, or arm it",
    R.LOSS_FAILSAFE: f"it would not stand without us, {SET_FAILSAFE}",
}


@dataclass(frozen=True, slots=True)
class Released:
    """A held task that a person has released, and that goes on when the vehicle is up."""

    task_id: TaskId
    again: bool
    may_continue: bool  # who has released it might also let the queue go on
    actor: str
    until: float
    waits_for: TaskReason


class Lineup:
    """What there is of tasks of the vehicle with this system id, and how it stands."""

    def __init__(
        self, vehicle: int, registry: TaskRegistry, room: PendingTasks, settings: Settings
    ) -> None:
        self.vehicle = vehicle
        self.registry = registry
        self.room = room
        self.settings = settings
        #: the tasks that are ready
        self.queue: TaskQueue = room.queue(vehicle)
        #: where it may drive, and where it returns to
        self.bounds = Bounds()
        self.executor = Executor(registry, settings, self.bounds)
        #: what its tasks go by beside their own terms
        self.terms = VehicleTerms(vehicle, registry, self.executor, self.bounds, settings)
        #: how many tasks of a submitter wait, on any vehicle
        self.count_of = room.count_of
        #: takes a task in; Rejection when too many wait
        self.submit = room.submit
        self.suspended_ids: dict[TaskId, None] = {}
        self.of_earlier_run: set[TaskId] = set()
        self.displaced = LedAway()
        #: why the queue stands, or NONE
        self.paused = R.NONE
        #: what made the vehicle stand, and when
        self.halts = Halts()
        #: the task that runs although the queue is paused
        self.immediate: TaskId | None = None
        #: killed: nothing begins before the vehicle stands
        self.stopping_after_kill = False
        self.begun_at = 0.0
        #: a held task that waits until the vehicle has restarted, or the queue goes on
        self.released: Released | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.vehicle}, {self.queue!r}, {self.paused.name})"

    @property
    def active(self) -> Task | None:
        """The task that has the vehicle: begun, not over and not set aside."""
        task_id = self.executor.task_id
        return None if task_id is None else self.registry.get(task_id)

    @property
    def suspended(self) -> list[Task]:
        """The tasks that are suspended."""
        return [self.registry[task_id] for task_id in self.suspended_ids]

    @property
    def is_driving(self) -> bool:
        """Whether any task has begun and is not over."""
        return self.active is not None or bool(self.suspended_ids)

    @property
    def is_stopped(self) -> bool:
        """Whether STOP is latched."""
        return self.paused is R.STOPPED

    @property
    def waiting(self) -> list[TaskId]:
        """Waiting tasks, next one first."""
        return self.room.of(self.vehicle)

    @property
    def next_waiting(self) -> TaskId | None:
        """The task that is next in the queue."""
        return self.queue.first()

    @property
    def capacity(self) -> int:
        """How many tasks may wait."""
        return self.settings.queueing.capacity

    @property
    def is_idle(self) -> bool:
        """Whether there is neither a active task nor one that could begin now."""
        return not self.is_driving and len(self.queue) == 0

    @property
    def is_empty(self) -> bool:
        """Whether there is no task at all that is not over."""
        return not self.is_driving and self.room.count(self.vehicle) == 0

    @property
    def unfinished(self) -> list[Task]:
        """All tasks that are not over, in the order of their ids."""
        active = [] if self.active is None else [self.active.id]
        return [
            self.registry[task_id]
            for task_id in sorted([*active, *self.suspended_ids, *self.waiting])
        ]

    def page(self, first: int, count: int) -> list[TaskId]:
        """Return up to ``count`` waiting tasks from a position on."""
        if first + count <= len(self.queue):
            return self.queue.page(first, count)
        if first >= self.room.count(self.vehicle):
            return []  # without putting all that wait in order
        return self.waiting[first : first + count]

    def start_time(self, task: Task) -> float:
        """Return the monotonic time before which a task does not begin; -inf without one."""
        return self.room.times.start(task.terms)

    def timing_of(self, task: Task) -> Timing | None:
        """Return how evenly a task's setpoints have left, None if it was not driven."""
        active = self.active
        return self.executor.timing if active is not None and active.id == task.id else task.timing

    @property
    def held(self) -> Task | None:
        """The task that somebody must decide about; None: there is none, or it is decided."""
        active = self.active
        if active is not None and active.state is S.HELD:
            return active if self.released is None else None
        return next((task for task in self.suspended if task.state is S.HELD), None)

    @property
    def is_held_ahead(self) -> bool:
        """Whether a held task keeps all others from beginning."""
        task_id = self.executor.task_id
        active = None if task_id is None else self.registry.get(task_id)
        if active is not None and active.state is S.HELD:
            return True
        return bool(self.suspended_ids) and any(task.state is S.HELD for task in self.suspended)

    @property
    def resumes_by_itself(self) -> bool:
        """Whether a task stands only as long as the vehicle, or its position, is not heard of."""
        return self.executor.resumes_by_itself

    @property
    def lost_since(self) -> float | None:
        """Since when, in s, a task has stood that resumes by itself; None: none does."""
        return self.executor.lost_since

    def waits(self, task: Task) -> bool:
        """Whether a task has not begun."""
        return task.state in WAITING

    # what several parts do

    def halt(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Note that the vehicle is to stand: what lets it go on has to be newer than this.

        What was to run at once and has not begun waits as any other; what was released and has not
        begun is held as before.
        """
        self.released = None
        if self.immediate is not None and (self.active is None or self.active.id != self.immediate):
            self.immediate = None
        if self.halts.raise_epoch(reason, actor=actor, now=now):
            epoch = self.halts.epoch
            self.registry.record(VehicleHalted(self.vehicle, epoch, reason, actor, now))

    def pause_queue(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Let the queue stand; a STOP is not undone, nor that somebody else has the vehicle."""
        if self.paused in (reason, R.STOPPED):
            return
        if self.paused in TAKEN and reason is R.OPERATOR:
            return  # a pause does not say that all is well with the vehicle again
        self.paused = reason
        self.registry.record(QueuePaused(self.vehicle, reason, actor, now))

    def set_aside(self, task_id: TaskId) -> None:
        """Let another task have the vehicle: this one has begun, and is not over."""
        self.executor.give_up()
        self.suspended_ids[task_id] = None

    def check_start(self, seen: VehicleView, goal: SingleGoal, *, now: float) -> None:
        """Raise Rejection, with what may be done about it, while a goal could not be begun."""
        blocker = start_blocker(seen, watch=self.settings.watch, now=now, goal=goal)
        if blocker:
            raise Rejection(blocker, f"cannot go on: {WAYS_OUT.get(blocker, words_of(blocker))}")

    def is_of_another_frame(self, task: Task, seen: VehicleView) -> bool:
        """Whether what is left of an earlier run was in coordinates that mean nothing any more."""
        return (
            task.id in self.of_earlier_run
            and task.progress.anchor is not None
            and not same_frame(task.progress.frame, seen.frame)
        )
