"""The tasks of one vehicle as they stand, and which of them comes next.

The STOP latch is the queue's pause reason STOPPED: there is no second flag. One task at a time has
the vehicle. Others may have started and be suspended: pre-empted, or held.
"""

from dataclasses import replace
from math import inf
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import SET_FAILSAFE, Driving, Settings
from mav_tasks.kinds import SingleGoal
from mav_tasks.kinds.guidance import Motion
from mav_tasks.kinds.path import distance
from mav_tasks.tasks.driving.bounds import Bounds, safe_braking
from mav_tasks.tasks.driving.executor import Executor
from mav_tasks.tasks.driving.mission_sequencer import goal_of
from mav_tasks.tasks.driving.stage import is_off_line
from mav_tasks.tasks.driving.watches import JumpWatch
from mav_tasks.tasks.events import (
    SERVER,
    QueuePaused,
    TaskWaits,
    VehicleArmingSet,
    VehicleHalted,
    VehicleIdentified,
    VehicleSpeedSet,
)
from mav_tasks.tasks.halts import DISABLED, Halts, Permit
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason, TaskState, words_of
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.queue import TaskQueue, outranks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task, TaskId, same_frame
from mav_tasks.tasks.timing import Timing
from mav_tasks.tasks.view import VehicleView, start_blocker

R, S = TaskReason, TaskState

#: what an operator can do about a refusal
WAYS_OUT = {
    R.WRONG_MODE: "wrong mode, set HOLD first",
    R.DISARMED: "disarmed, arm it or press Continue",
    R.LOSS_FAILSAFE: f"it might drive on without setpoints, {SET_FAILSAFE}",
}
LEAVES_MODE = 1.5  # s in which a heartbeat shows the mode that was asked for with a task
LED_AWAY = 2.0  # m, beyond its braking, from where tasks drove it last: something else moved it


class Released(NamedTuple):
    """A held task that a person has released, and that waits for the vehicle or the queue."""

    task_id: TaskId
    again: bool
    may_continue: bool  # the releasing client may also resume the queue
    actor: str
    until: float
    waits_for: TaskReason


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
        #: how many tasks of a submitter's owner wait, on any vehicle
        self.count_of = room.count_of
        #: add a task; raise Rejection if too many wait
        self.submit = room.submit
        #: suspended tasks, and whether anything but tasks may have moved the vehicle since: then
        #: nobody knows the way back to their lines. Their client knows the way of later tasks
        self.suspended_ids: dict[TaskId, bool] = {}
        self.of_earlier_run: set[TaskId] = set()
        self._left: Motion | None = None  # when a task last had the vehicle
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
        #: a held task that waits until the vehicle has rebooted, or the queue resumes
        self.release_permit = Permit[Released](self.halts)
        #: the vehicle at the last step
        self.seen: VehicleView | None = None
        self._jumps = JumpWatch()
        #: the unique id of the vehicle of these tasks, "" until it was heard
        self.uid = ""
        #: no person has disarmed it, or one has allowed arming since
        self.may_be_armed = True
        self.speed: float | None = None  #: m/s, of goals that name none; None: the settings' one
        self._cruise: float | None = None  # m/s, the vehicle's own cruise speed
        self._stop: tuple[float, float] | None = None  # m/s and m of a measured stop
        self._begun_at = 0.0
        self._blocked = -1, R.NONE  # the next task, and why it does not start
        self._told_at = inf  # s, when that is recorded

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
    def begun(self) -> list[Task]:
        """The tasks that have started and are not over: the active one first."""
        active = self.active
        return self.suspended if active is None else [active, *self.suspended]

    @property
    def released(self) -> Released | None:
        """The last release, while its task waits and nothing has halted the vehicle since."""
        return self.release_permit.holder()

    @property
    def is_driving(self) -> bool:
        """Whether any task has started and is not over."""
        return self.executor.task_id is not None or bool(self.suspended_ids)

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
        tasks = self.begun + [self.registry[task_id] for task_id in self.waiting]
        return sorted(tasks, key=lambda task: task.id)

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
        return self.executor.timing if self.executor.task_id == task.id else task.timing

    @property
    def held(self) -> Task | None:
        """The held task that needs a decision; None without one, or once it is released."""
        held = next((task for task in self.begun if task.state is S.HELD), None)
        is_active = held is not None and held.id == self.executor.task_id
        return None if is_active and self.released is not None else held

    @property
    def is_held_ahead(self) -> bool:
        """Whether a held task keeps all others from starting."""
        return self.registry.counts[self.vehicle][S.HELD] > 0

    # values of the vehicle that hold for all its tasks

    def apply(self, settings: Settings) -> None:
        self.settings = settings
        self._apply_driving()

    def _apply_driving(self) -> None:
        self.executor.apply(replace(self.settings, driving=self.driving))
        self.executor.drive.cruise = self._cruise if self.speed is None else None

    @property
    def driving(self) -> Driving:
        """Driving settings, with the speed set by a client, and the measured braking."""
        driving = self.settings.driving
        if self._stop is not None:
            driving = replace(driving, acceleration=safe_braking(driving, *self._stop))
        return driving if self.speed is None else replace(driving, speed=self.speed)

    def cruises(self, speed: float | None) -> None:
        """Note the vehicle's own cruise speed, m/s; None: unknown."""
        if speed != self._cruise:
            self._cruise = speed
            self._apply_driving()

    def brakes(self, stop: tuple[float, float] | None) -> None:
        """Note a measured stop: the speed in m/s and the metres that it took; None: unknown."""
        if stop != self._stop:
            self._stop = stop
            self._apply_driving()

    def let_arm(self, *, may_be_armed: bool, now: float) -> None:
        """Set whether the vehicle may be armed; a person who disarms it forbids that. Store it."""
        if may_be_armed != self.may_be_armed:
            self.may_be_armed = may_be_armed
            self.registry.record(VehicleArmingSet(self.vehicle, may_be_armed, now))

    def is_another(self, uid: str, *, now: float) -> bool:
        """Note the reported unique id. Return whether it is another vehicle than the tasks' own.

        A vehicle that does not know its id reports "", which changes nothing.
        """
        if not uid or uid == self.uid:
            return False
        before, self.uid = self.uid, uid
        self.registry.record(VehicleIdentified(self.vehicle, uid, now))
        return bool(before)

    def set_speed(self, speed: float | None, *, actor: str, now: float) -> TaskId | None:
        """Set the speed of the active task, and of later goals that name none.

        Return the active task's id, or None.
        """
        if speed != self.speed:
            self.registry.record(VehicleSpeedSet(self.vehicle, speed, actor, now))
        self.speed = speed
        self._apply_driving()
        self.executor.set_speed(speed)
        return self.executor.task_id

    def reset_speed(
        self, active: Task | None, speed: float | None, *, instead_of: float | None, now: float
    ) -> None:
        """Undo ``set_speed``; ``active`` was the active task, which a plan may have set since."""
        present = self.active
        own = None if present is None else present.progress.speed
        self.set_speed(speed, actor=SERVER, now=now)
        if present is not None and own != instead_of:
            self.executor.set_speed(own)
        elif present is not None and active is not None and active.id == present.id:
            self.executor.set_speed(active.progress.speed)

    # halts

    def halt(self, reason: TaskReason, *, actor: str = SERVER, now: float) -> None:
        """Record a halt of the vehicle; a request to resume must be newer.

        An immediate task that has not started becomes an ordinary waiting one.
        """
        if self.immediate != self.executor.task_id:
            self.immediate = None
        if self.halts.raise_epoch(reason, actor=actor, now=now):
            self.registry.record(VehicleHalted(self.vehicle, self.halts.epoch, reason, actor, now))

    def pause_queue(self, reason: TaskReason, *, actor: str = SERVER, now: float) -> None:
        """Pause the queue; this undoes neither a STOP nor a takeover."""
        if self.paused in (reason, R.STOPPED):
            return
        if self.paused in TAKEN and reason is R.OPERATOR:
            return  # a pause does not say that the vehicle is ours again
        self.paused = reason
        self.registry.record(QueuePaused(self.vehicle, reason, actor, now))

    def keeps(self, task: Task) -> bool:
        """Return whether a waiting task stays with this vehicle because somebody has halted it.

        A takeover that a text of the vehicle has explained was its own failsafe's.
        """
        reason, at = self.halts.by_somebody
        if reason is R.TAKEOVER and self.paused is R.FAILSAFE:
            at = -inf
        return at >= task.submitted_at or (bool(self.paused) and self.paused not in DISABLED)

    # whose turn it is

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

    def blocker_of(self, task_id: TaskId) -> TaskReason:
        """Return what blocks the next, an active or a released task; NONE for others."""
        if self.released is not None and self.released.task_id == task_id:
            return self.released.waits_for
        if self.executor.task_id == task_id:
            return self.executor.waits_for[0]
        return self._blocked[1] if self._blocked[0] == task_id else R.NONE

    @property
    def next_id(self) -> TaskId | None:
        """The next task to start: the immediate one, a pre-empted one, or a waiting one."""
        immediate = self.immediate
        if immediate is not None and (immediate in self.queue or immediate in self.suspended_ids):
            return immediate
        if self.paused or self.is_held_ahead:
            return None
        first = self.queue.first()
        if not self.suspended_ids:
            return first
        best = min(self.suspended, key=self.room.rank)  # all of them are paused: none is held
        if first is not None and self.queue.rank(first) < self.room.rank(best):
            return first
        return best.id

    def set_aside(self, task_id: TaskId) -> None:
        """Suspend the active task, so that another one can have the vehicle."""
        self.executor.give_up()
        self.suspended_ids[task_id] = self._left is None  # since an earlier run

    def note_moved(self, seen: VehicleView) -> None:
        """Note in each suspended task if the vehicle is not where a task of ours left it."""
        left, motion = self._left, seen.motion
        if left is None or motion is None:
            return
        rolls = left.speed**2 / (2 * self.driving.acceleration)
        if distance(left.pose, motion.pose) > LED_AWAY + rolls:
            self.suspended_ids = dict.fromkeys(self.suspended_ids, True)

    def is_interrupted(self, seen: VehicleView, *, now: float) -> bool:
        """Let a waiting task pre-empt the running one, if it may and can start. Return whether."""
        running, queueing = self.active, self.settings.queueing
        if running is None or self.paused or not self.queue or self.is_held_ahead:
            return False
        if now - self._begun_at < queueing.preemption_rest:
            return False
        for task_id in self.queue.interrupters():
            waiting = self.registry[task_id]
            is_too_late = self.room.times.is_too_late(waiting, now=now)
            if not self.registry.is_durable(task_id) or is_too_late:
                continue
            outranked = outranks(waiting, running, queueing=queueing)
            if outranked and not self.blocker(seen, goal_of(waiting), now=now):
                self.executor.pause(R.PREEMPTED, now=now)
                self.set_aside(running.id)
                self._begin(waiting, seen, now=now)
                return True
        return False

    def begin_next(self, seen: VehicleView, *, now: float) -> None:
        """Start the next task, if it can start."""
        first = None if self.executor.task_id is not None else self.next_id
        if first is None:
            return
        task = self.registry[first]
        if task.state is S.QUEUED and self.room.times.is_too_late(task, now=now):
            self.room.handle_deadline(now=now)  # after a delay this may precede its timer
            self.begin_next(seen, now=now)
            return
        blocker = self.blocker(seen, goal_of(task), now=now)
        self._note_blocker(first, blocker, now=now)
        if not blocker and self.registry.is_durable(first):
            self._begin(task, seen, now=now)

    def _begin(self, task: Task, seen: VehicleView, *, now: float) -> None:
        if task.state is S.QUEUED:
            self.room.leave(task)
        self.note_moved(seen)
        was_moved = self.suspended_ids.pop(task.id, False)
        self._begun_at = now
        lost = R.NONE
        if self.is_of_another_frame(task, seen):
            lost = R.FRAME_RESET
        elif was_moved and seen.motion is not None and is_off_line(task, seen.motion.pose):
            lost = R.OFF_TRACK
        if lost:
            self.executor.adopt(task)
            self.executor.hold(lost, now=now)
        else:
            self.executor.begin(task, now=now)

    def _note_blocker(self, first: TaskId, blocker: TaskReason, *, now: float) -> None:
        """Note why the next task does not start, and record it each time that it changes."""
        if (first, blocker) != self._blocked:
            self._told_at = now + (LEAVES_MODE if blocker is R.WRONG_MODE else 0.0)
        self._blocked = first, blocker
        if blocker and now >= self._told_at:
            self._told_at = inf
            self._tell_wait(first, blocker, now=now)

    def _tell_wait(self, task_id: TaskId, reason: TaskReason, *, now: float) -> None:
        self.registry.record(TaskWaits(task_id, self.vehicle, reason, now))
