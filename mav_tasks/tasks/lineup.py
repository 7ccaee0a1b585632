"""The tasks of one vehicle as they stand: queue, active and suspended tasks, and the pause.

The STOP latch is the queue's pause reason STOPPED: there is no second flag. One task at a time has
the vehicle. Others may have started and be suspended: pre-empted, or held.
"""

from dataclasses import dataclass
from math import inf

from mav_tasks.errors import Rejection
from mav_tasks.settings import SET_FAILSAFE, Settings
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.watches import LedAway
from mav_tasks.tasks.events import QueuePaused, VehicleHalted
from mav_tasks.tasks.executor import Executor
from mav_tasks.tasks.goal import SingleGoal
from mav_tasks.tasks.halts import DISABLED, Halts
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason, TaskState, words_of
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.queue import TaskQueue
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.task import Task, TaskId, same_frame
from mav_tasks.tasks.timing import Timing
from mav_tasks.tasks.vehicle_terms import VehicleTerms
from mav_tasks.tasks.view import VehicleView

R, S = TaskReason, TaskState

#: what an operator can do about a refusal
WAYS_OUT = {
    R.WRONG_MODE: "wrong mode, set HOLD first",
    R.DISARMED: "disarmed, arm it or press Continue",
    R.LOSS_FAILSAFE: f"it might drive on without setpoints, {SET_FAILSAFE}",
}


@dataclass(frozen=True, slots=True)
class Released:
    """A held task that a person has released, and that waits for the vehicle or the queue."""

    task_id: TaskId
    again: bool
    may_continue: bool  # the releasing client may also resume the queue
    actor: str
    until: float
    waits_for: TaskReason
    term: int  # in which it was released


class Lineup:
    """State of the tasks of the vehicle with this system id."""

    def __init__(
        self, vehicle: int, registry: TaskRegistry, room: PendingTasks, settings: Settings
    ) -> None:
        self.vehicle = vehicle
        self.registry = registry
        self.room = room
        self.settings = settings
        #: the tasks that are ready
        self.queue: TaskQueue = room.queue(vehicle)
        #: its fence, rally points and home
        self.bounds = Bounds()
        self.executor = Executor(registry, settings, self.bounds, room.times)
        #: values of the vehicle that hold for all its tasks
        self.terms = VehicleTerms(vehicle, registry, self.executor, settings)
        #: how many tasks of a submitter's owner wait, on any vehicle
        self.count_of = room.count_of
        #: add a task; raise Rejection if too many wait
        self.submit = room.submit
        self.suspended_ids: dict[TaskId, None] = {}
        self.of_earlier_run: set[TaskId] = set()
        self.displaced = LedAway()
        #: why the queue is paused, or NONE
        self.paused = R.NONE
        #: when another vehicle with its id was heard last
        self.twin_heard_at = -inf
        #: the halts of the vehicle
        self.halts = Halts()
        #: the task that runs although the queue is paused
        self.immediate: TaskId | None = None
        #: a task was killed: nothing starts before the vehicle stands, or a takeover
        self.stopping_after_kill = False
        self.begun_at = 0.0
        #: a held task that waits until the vehicle has rebooted, or the queue resumes
        self.last_released: Released | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.vehicle}, {self.queue!r}, {self.paused.name})"

    @property
    def active(self) -> Task | None:
        """The task that has the vehicle: started, not over and not suspended."""
        task_id = self.executor.task_id
        return None if task_id is None else self.registry.get(task_id)

    @property
    def suspended(self) -> list[Task]:
        """Suspended tasks: pre-empted, or held."""
        return [self.registry[task_id] for task_id in self.suspended_ids]

    @property
    def released(self) -> Released | None:
        """The last release, while its task waits and nothing has halted the vehicle since."""
        last = self.last_released
        return last if last is not None and last.term == self.halts.term else None

    @property
    def is_driving(self) -> bool:
        """Whether any task has started and is not over."""
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
    def is_idle(self) -> bool:
        """Whether no task is active, suspended or ready to start."""
        return not self.is_driving and len(self.queue) == 0

    @property
    def is_empty(self) -> bool:
        """Whether all tasks are over."""
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
            return []  # without sorting all waiting tasks
        return self.waiting[first : first + count]

    def start_time(self, task: Task) -> float:
        """Return the monotonic time before which a task does not start; -inf if it has none."""
        return self.room.times.start(task.terms)

    def timing_of(self, task: Task) -> Timing | None:
        """Return a task's setpoint timing, None if it was not driven."""
        active = self.active
        return self.executor.timing if active is not None and active.id == task.id else task.timing

    @property
    def held(self) -> Task | None:
        """The held task that needs a decision; None without one, or once it is released."""
        active = self.active
        if active is not None and active.state is S.HELD:
            return active if self.released is None else None
        return next((task for task in self.suspended if task.state is S.HELD), None)

    @property
    def is_held_ahead(self) -> bool:
        """Whether a held task keeps all others from starting."""
        active = self.active
        if active is not None and active.state is S.HELD:
            return True
        return any(task.state is S.HELD for task in self.suspended)

    # shared by several parts

    def halt(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Record a halt of the vehicle; a request to resume must be newer.

        An immediate task that has not started becomes an ordinary waiting one.
        """
        if self.immediate is not None and (self.active is None or self.active.id != self.immediate):
            self.immediate = None
        if self.halts.raise_epoch(reason, actor=actor, now=now):
            self.registry.record(VehicleHalted(self.vehicle, self.halts.epoch, reason, actor, now))

    def pause_queue(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Pause the queue; this undoes neither a STOP nor a takeover."""
        if self.paused in (reason, R.STOPPED):
            return
        if self.paused in TAKEN and reason is R.OPERATOR:
            return  # a pause does not say that the vehicle is ours again
        self.paused = reason
        self.registry.record(QueuePaused(self.vehicle, reason, actor, now))

    def set_aside(self, task_id: TaskId) -> None:
        """Suspend the active task, so that another one can have the vehicle."""
        self.executor.give_up()
        self.suspended_ids[task_id] = None

    def keeps(self, task: Task) -> bool:
        """Return whether a waiting task stays with this vehicle because somebody has halted it.

        A takeover that a text of the vehicle has explained was its own failsafe's.
        """
        reason, at = self.halts.by_somebody
        if reason is R.TAKEOVER and self.paused is R.FAILSAFE:
            at = -inf
        return at >= task.submitted_at or (bool(self.paused) and self.paused not in DISABLED)

    def blocker(self, seen: VehicleView, goal: SingleGoal, *, now: float) -> TaskReason:
        """Return why no task with this goal can take control of the vehicle now, or NONE."""
        return start_blocker(seen, watch=self.settings.watch, now=now, goal=goal)

    def check_start(self, seen: VehicleView, goal: SingleGoal, *, now: float) -> None:
        """Raise Rejection, with a remedy, if a task with this goal could not start now."""
        if blocker := self.blocker(seen, goal, now=now):
            raise Rejection(blocker, f"cannot start: {WAYS_OUT.get(blocker, words_of(blocker))}")

    def is_of_another_frame(self, task: Task, seen: VehicleView) -> bool:
        """Return whether a task of an earlier run has coordinates in a frame that is gone."""
        return (
            task.id in self.of_earlier_run
            and task.progress.anchor is not None
            and not same_frame(task.progress.frame, seen.frame)
        )
