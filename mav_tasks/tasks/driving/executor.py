"""Runs the active task of one vehicle: from STARTING to its end, through every interruption.

It returns demands (``view``) and changes states through the registry only. The first non-zero
velocity waits until EXECUTING is durable; zeros never wait.
"""

from dataclasses import dataclass, replace

from mav_tasks.basics.histogram import Histogram
from mav_tasks.config.settings import Settings
from mav_tasks.kinds import Pose
from mav_tasks.tasks import view
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.drive import Becomes, Drive
from mav_tasks.tasks.driving.mission_sequencer import goal_of
from mav_tasks.tasks.driving.stage import is_off_line, was_handled
from mav_tasks.tasks.events import SERVER, TaskWaits
from mav_tasks.tasks.lifecycle import LOSSES, TAKEN, TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Progress, Task, TaskId
from mav_tasks.tasks.times import Times
from mav_tasks.tasks.timing import INTERVALS, Timing, TimingMeter
from mav_tasks.tasks.view import Demand, ModeKind, VehicleView, start_blocker

S, R = TaskState, TaskReason

#: m/s and s: a vehicle that creeps below this speed on zeros is driven after this time. A speed
#: loop that wound up on the estimate's offset may never let it stand (PX4, RO_SPEED_I 0.5)
CREEPS, CREEPS_FOR = 0.3, 6.0
ASK_AGAIN = 4.0  # s, from the end of one attempt to arm to the next, while a vehicle is not ready


def has_moved(task: Task) -> bool:
    """Return whether any part of a task may have been driven."""
    return task.progress.anchor is not None or task.progress.execution_time > 0.0


@dataclass(slots=True)
class _Loss:
    """Why a PAUSED task resumes by itself: its vehicle, or the position, is not heard."""

    bad_at: float  # when data was last bad
    pose: Pose | None = None  # the last one before it
    untaken_in: ModeKind | None = None  # the mode then, if we had sent nothing
    is_taken_over: bool = False  # from another gateway
    was_silent: bool = False  # heartbeats were lost, too


class Executor:
    """State machine of one vehicle's active task, if there is one."""

    def __init__(
        self, registry: TaskRegistry, settings: Settings, bounds: Bounds, times: Times
    ) -> None:
        self._registry = registry
        self._settings = settings
        #: drives the task while it is EXECUTING
        self.drive = Drive(registry, settings, bounds, times)
        self.task_id: TaskId | None = None  #: of the active task
        self._since = 0.0  # when the current state was entered
        self._executed_before = 0.0  # s of EXECUTING before the current state
        self._last_tick = 0.0
        self._loss: _Loss | None = None  # None: a PAUSED task waits for somebody
        self._meter: TimingMeter | None = None  # while EXECUTING
        #: intervals between setpoints of all tasks of this run, s
        self.intervals = Histogram(INTERVALS)
        self._taking_since = 0.0  # while STARTING, or EXECUTING without control
        self._ask_again_at: float | None = None  # next attempt to arm, if not ready
        #: what a STARTING task waits for, and the vehicle's own words for that
        self.waits_for: tuple[TaskReason, str] = (R.NONE, "")

    def __repr__(self) -> str:
        return f"Executor({self.task!r})"

    @property
    def task(self) -> Task | None:
        """The active task."""
        return None if self.task_id is None else self._registry.get(self.task_id)

    @property
    def timing(self) -> Timing | None:
        """Setpoint timing of the active task so far."""
        measured = None if self._meter is None else self._meter.timing()
        return measured or (None if self.task is None else self.task.timing)

    def setpoint_left(self, *, now: float) -> None:
        """Note that a setpoint is sent to the vehicle now."""
        if self._meter is not None:
            self._meter.note(now=now)

    def apply(self, settings: Settings) -> None:
        self._settings = self.drive.settings = settings

    # requests

    def begin(self, task: Task, *, now: float) -> None:
        """Start a queued or a pre-empted task: it becomes STARTING."""
        self.adopt(task)
        self._change(S.STARTING, now=now)

    def adopt(self, task: Task) -> None:
        """Make a task the active one, in the state that it has."""
        self.task_id = task.id
        self._executed_before = task.progress.execution_time
        self._loss = None

    def take_over(self, task: Task, *, now: float) -> None:
        """Make a task the active one that another gateway drove; it resumes by itself."""
        self.adopt(task)
        self._since, self._loss = now, _Loss(now, is_taken_over=True)

    def give_up(self) -> None:
        """Drop the active task in the state that it has, to make room for another."""
        self.task_id = None
        self.drive.forget()

    def resume(self, seen: VehicleView, *, actor: str = SERVER, now: float) -> None:
        """Resume a PAUSED task exactly where it was.

        If the vehicle was moved off the task's line, hold the task rather than drive back blindly.
        """
        task = self.task
        if task is not None and seen.motion and is_off_line(task, seen.motion.pose):
            self._change(S.HELD, R.OFF_TRACK, actor=actor, now=now)
        else:
            self._change(S.STARTING, actor=actor, now=now)

    def release(self, task: Task, *, again: bool, actor: str, now: float) -> None:
        """Restart the active HELD task: all of it from here (``again``), or the remainder."""
        progress = task.progress
        if again:
            progress = Progress(execution_time=progress.execution_time, driven=progress.driven)
        elif task.reason in (R.FRAME_RESET, R.OFF_TRACK):
            # its line is lost or left for good: keep the distance driven, not the start pose
            progress = replace(progress, anchor=None, frame=None, target=None, path=())
        elif task.reason is R.OUTCOME_UNKNOWN:
            progress = replace(progress, done=goal_of(task).released(progress.done))
        self._change(S.STARTING, actor=actor, now=now, progress=progress)

    def act_answered(
        self, task_id: TaskId, step: int, accepted: bool | None, *, was_sent: bool, now: float
    ) -> bool:
        """Note the vehicle's answer to an act, which may be set aside; None: none came in time.

        Return whether it was awaited.
        """
        task = self._registry.get(task_id)
        if task is None:
            return False
        is_active = task_id == self.task_id
        return self.drive.act_answered(
            task, step, accepted, was_sent=was_sent, is_active=is_active, now=now
        )

    def set_speed(self, speed: float | None) -> None:
        """Set the speed of the active task from now on, m/s; None: the task's own.

        The later one of a plan's SetSpeed and a client's request wins.
        """
        if (task := self.task) is not None:
            self._registry.note_progress(task.id, replace(task.progress, speed=speed))
            self.drive.set_speed(speed)

    def pause(self, reason: TaskReason, *, actor: str = SERVER, now: float) -> None:
        """Pause a STARTING or EXECUTING task; stop a lost one from resuming by itself."""
        task = self.task
        self._loss = None  # no edge PAUSED -> PAUSED, but a lost task no longer resumes by itself
        if task is not None and task.state in (S.STARTING, S.EXECUTING):
            self._change(S.PAUSED, reason, actor=actor, now=now)

    def hold(self, reason: TaskReason, *, now: float) -> None:
        """Hold the active task until a client decides.

        A STARTING task that has not moved has no line to lose, so FRAME_RESET does not hold it: a
        booting rover may find its position while it is being taken.
        """
        task = self.task
        if task is None or task.state not in (S.STARTING, S.EXECUTING, S.PAUSED):
            return
        if reason is not R.FRAME_RESET or task.state is not S.STARTING or has_moved(task):
            self._change(S.HELD, reason, now=now)

    def cancel(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Cancel the active task: send zeros at once, and end it when the vehicle stands.

        A HELD task, or one that a takeover has paused, ends at once.
        """
        task = self.task
        if task is None or task.state is S.CANCELLING:
            return
        if task.state is not S.HELD:
            self._change(S.CANCELLING, reason, actor=actor, now=now)
        if task.state is S.HELD or task.reason in TAKEN:
            self._change(S.CANCELLED, reason, actor=actor, now=now)

    def let_go(self, *, actor: str = SERVER, now: float) -> TaskId | None:
        """End a CANCELLING task without standstill: its vehicle was taken over, or has rebooted.

        Return its id, or None.
        """
        task = self.task
        if task is None or task.state is not S.CANCELLING:
            return None
        self._change(S.CANCELLED, task.reason, actor=actor, now=now)
        return task.id

    def kill(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """End the active task at once. Return its id, or None."""
        killed = self.task_id
        if killed is not None:
            self._change(S.KILLED, reason, actor=actor, now=now)
        return killed

    @property
    def lost_since(self) -> float | None:
        """When the task was paused by a loss, in s; None if it does not resume by itself."""
        return self._since if self.resumes_by_itself else None

    @property
    def resumes_by_itself(self) -> bool:
        """Whether the task is paused only until the vehicle, or its position, is heard again."""
        task = self.task
        return task is not None and task.state is S.PAUSED and self._loss is not None

    # demands on the vehicle

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Return what the active task demands of the vehicle; its state may change."""
        task = self.task
        if task is None:
            return view.HOLD
        elapsed = min(now - self._last_tick, 2 * self._settings.watch.setpoint_period)
        self._last_tick = now
        return self.drive.limit(self._step(task, seen, elapsed, now=now), elapsed=elapsed, now=now)

    def _step(self, task: Task, seen: VehicleView, elapsed: float, *, now: float) -> Demand:
        match task.state:
            case S.STARTING | S.EXECUTING:
                try:
                    return self._run(task, seen, elapsed, now=now)
                except Becomes as outcome:
                    self._change(outcome.state, outcome.reason, now=now)
            case S.PAUSED if self._loss is not None:
                self._wait_for_return(task, self._loss, seen, now=now)
            case S.CANCELLING if seen.still:
                self._change(S.CANCELLED, task.reason, now=now)
            case S.CANCELLING if now - self._since > self._settings.watch.stop_unconfirmed:
                self._change(S.HELD, R.STOP_UNCONFIRMED, now=now)
                return view.HALT
            case S.HELD if task.reason is R.STOP_UNCONFIRMED and not seen.still:
                is_led = seen.mode in (ModeKind.MANUAL, ModeKind.OTHER)  # somebody else drives it
                return view.HOLD if is_led else view.HALT
        return view.HOLD

    def begins_again(self, *, now: float) -> bool:
        """Restart a task that has not moved, after a reboot. Return whether it restarts.

        It waits until the vehicle is ready, as a task submitted a moment later would.
        """
        task = self.task
        if task is None or has_moved(task):
            return False
        if self.resumes_by_itself:  # the vehicle was silent for a while
            self._change(S.STARTING, now=now)
        elif task.state is not S.STARTING:
            return False
        self.waits_for = (R.NOT_READY, "the rover restarted")
        self._ask_again_at, self._taking_since = None, now
        return True

    def _run(self, task: Task, seen: VehicleView, elapsed: float, *, now: float) -> Demand:
        """Take the vehicle, and drive it once it is ours and its position is fresh."""
        is_starting = task.state is S.STARTING
        is_waited_for = is_starting and now - self._since < self._settings.watch.ready_timeout
        if is_waited_for and self._waits_to_take(task, seen, now=now):
            return view.HOLD
        if self._pause_if_lost(seen, now=now):
            return view.HOLD
        if is_waited_for and seen.refusal and seen.is_not_ready:
            return self._wait_until_ready(task, seen.why_not_ready, now=now)
        if is_starting and (why := seen.refusal or (R.LOSS_FAILSAFE if seen.drives_on else R.NONE)):
            raise Becomes(S.FAILED, why)
        taking, start_timeout = now - self._taking_since, self._settings.watch.start_timeout
        if not seen.in_control and taking > start_timeout:
            raise Becomes(S.FAILED, R.START_TIMEOUT)
        if not seen.in_control:
            return view.TAKE
        if not is_starting:
            self._taking_since = now
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        if is_starting:
            creeps = taking > CREEPS_FOR and motion.speed < CREEPS
            if not seen.still and not creeps:  # the start heading must be measured at rest
                # not since it began to start: it may have waited until it was ready to arm
                if taking > 2 * start_timeout:
                    raise Becomes(S.FAILED, R.START_TIMEOUT)
                return view.STAND
            progress = self.drive.begin(task, seen, motion, now=now)
            self._change(S.EXECUTING, now=now, progress=progress)
            return view.STAND
        executed = self._executed_before + now - self._since
        return self.drive.go_on(task, seen, motion, executed=executed, elapsed=elapsed, now=now)

    def _waits_to_take(self, task: Task, seen: VehicleView, *, now: float) -> bool:
        """Return whether a STARTING task waits: it is not ready, or in somebody's mode."""
        blocker = start_blocker(seen, watch=self._settings.watch, now=now)
        if blocker and self.waits_for[0] is R.NOT_READY and not has_moved(task):
            self._taking_since = now
            return True
        return blocker is R.WRONG_MODE  # it resumes out of that mode

    def _wait_until_ready(self, task: Task, words: str, *, now: float) -> Demand:
        """Wait after a refused arming; return TAKE when it is time for another attempt."""
        if self._ask_again_at is None:  # an attempt has just failed: report why
            self._ask_again_at = now + ASK_AGAIN
            if self.waits_for != (R.NOT_READY, words):
                self._registry.record(TaskWaits(task.id, task.vehicle, R.NOT_READY, now, words))
        self.waits_for = (R.NOT_READY, words)
        if now < self._ask_again_at:
            return view.STAND
        self._ask_again_at, self._taking_since = None, now
        return view.TAKE

    def _pause_if_lost(self, seen: VehicleView, *, now: float) -> bool:
        """Pause the task if lease, heartbeats or position are missing. Return whether so."""
        motion = seen.motion
        if not seen.is_ours:
            lost = R.LEASE_LOST
        elif not seen.heard:
            lost = R.LINK_LOST
        elif motion is None or now - motion.at > self._settings.watch.position_lost:
            lost = R.POSITION_LOST
        else:
            return False
        untaken_in = seen.mode if seen.is_untouched and not seen.armed else None
        self._change(S.PAUSED, lost, now=now)
        self._loss = _Loss(now, None if motion is None else motion.pose, untaken_in)
        return True

    def _wait_for_return(self, task: Task, loss: _Loss, seen: VehicleView, *, now: float) -> None:
        """Resume a task PAUSED by a loss after a while of good data; fail it after a time-out."""
        watch = self._settings.watch
        if not seen.is_ours:  # the time-out is for vehicles that stay silent
            self._since = loss.bad_at = now
            return
        if now - self._since > watch.lost_timeout:
            # taken over, and silent, or not as it was left: the gateway before may have ended it
            unknown = S.HELD, R.OUTCOME_UNKNOWN
            lost = unknown if loss.is_taken_over else (S.FAILED, R.LINK_TIMEOUT)
            self._change(*lost, now=now)
            return
        loss.was_silent |= not seen.heard
        if seen.armed:
            ours = seen.mode in (ModeKind.OURS, ModeKind.HOLD)
        else:  # in the mode that it had when it was lost, before we took it
            ours = seen.mode is loss.untaken_in
        if not ours or start_blocker(seen, watch=watch, now=now, goal=goal_of(task)):
            loss.bad_at = now
        elif now - loss.bad_at >= watch.fresh_before_resume:
            there, here = loss.pose if loss.was_silent else None, seen.motion
            if there is not None and here is not None and was_handled(task, there, here.pose):
                self._change(S.HELD, R.OFF_TRACK, now=now)
            else:
                self.resume(seen, now=now)

    # states

    def _change(
        self,
        new: TaskState,
        reason: TaskReason = R.NONE,
        *,
        actor: str = SERVER,
        now: float,
        progress: Progress | None = None,
    ) -> None:
        """Change the state of the active task, which is given up if it is over."""
        assert self.task_id is not None
        old, timing = self._registry[self.task_id], None
        if old.state is S.EXECUTING:
            self._executed_before += now - self._since
            progress = replace(old.progress, execution_time=self._executed_before)
            timing, self._meter = self.timing, None
        self._since = self._taking_since = now
        self.drive.entered(now=now)
        self._ask_again_at, self.waits_for = None, (R.NONE, "")
        self._registry.change(
            old.id, new, reason=reason, actor=actor, now=now, progress=progress, timing=timing
        )
        if new is S.EXECUTING:
            period = self._settings.watch.setpoint_period
            self._meter = TimingMeter(period=period, before=old.timing, every=self.intervals)
        elif new is S.PAUSED and reason in LOSSES:
            self._loss = _Loss(now)
        elif new in TERMINAL:
            self.give_up()
