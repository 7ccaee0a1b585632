"""Runs the one active task of a vehicle: from STARTING to its end, through every interruption.

It asks for nothing but demands (``view``) and changes states through the registry only. Its first
non-zero velocity waits until EXECUTING is durable; zeros never wait.
"""

from dataclasses import replace

from mav_tasks.settings import Settings
from mav_tasks.tasks import view
from mav_tasks.tasks.drive import Becomes, Drive
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.mission_sequencer import goal_of
from mav_tasks.tasks.driving.recovery_path import is_off_line, was_handled
from mav_tasks.tasks.events import SERVER, TaskWaits
from mav_tasks.tasks.lifecycle import LOSSES, TAKEN, TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.task import Pose, Progress, Task, TaskId
from mav_tasks.tasks.timing import Timing, TimingMeter
from mav_tasks.tasks.view import Demand, ModeKind, VehicleView

S, R = TaskState, TaskReason

#: m/s and s after which a vehicle that creeps on zeros is driven: a speed loop that has wound up on
#: the estimate's offset may never let it stand (PX4, RO_SPEED_I 0.5)
CREEPS, CREEPS_FOR = 0.3, 6.0
ASK_AGAIN = 4.0  # s, from the end of a try to arm to the next one, while a vehicle is not ready


def has_moved(task: Task) -> bool:
    """Return whether anything of a task may have been driven."""
    return task.progress.anchor is not None or task.progress.execution_time > 0.0


class Executor:
    """The active task of one vehicle, if there is one."""

    def __init__(self, registry: TaskRegistry, settings: Settings, bounds: Bounds) -> None:
        self._registry = registry
        self._settings = settings
        #: what drives it
        self.drive = Drive(registry, settings, bounds)
        self.task_id: TaskId | None = None  #: of the active task
        self._since = 0.0  # when the present state was entered
        self._executed_before = 0.0  # s of EXECUTING in earlier stretches
        self._last_tick = 0.0
        self._lost_until = 0.0  # while PAUSED by a loss: when data was last not good
        self._resumes_by_itself = False
        self._lost_at: Pose | None = None  # where it was last, before the loss
        self._was_silent = False  # during it
        self._untaken_in: ModeKind | None = None  # when it was lost, and nothing was asked of it
        self._meter: TimingMeter | None = None  # while EXECUTING
        self._taking_since = 0.0  # while STARTING, or EXECUTING and out of control
        self._ask_again_at: float | None = None  # while the vehicle is not ready, between two tries
        #: what a STARTING task waits for, and that in the vehicle's own words
        self.waits_for: tuple[TaskReason, str] = (R.NONE, "")

    def __repr__(self) -> str:
        return f"Executor({self.task!r})"

    @property
    def task(self) -> Task | None:
        """The active task."""
        return None if self.task_id is None else self._registry[self.task_id]

    @property
    def timing(self) -> Timing | None:
        """How evenly the active task's setpoints have left up to now."""
        measured = None if self._meter is None else self._meter.timing()
        return measured or (None if self.task is None else self.task.timing)

    def setpoint_left(self, *, now: float) -> None:
        """A setpoint leaves for the vehicle now."""
        if self._meter is not None:
            self._meter.note(now=now)

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        self.drive.apply(settings)

    # what others want of it

    def begin(self, task: Task, *, actor: str, now: float) -> None:
        """Take a queued task on, or one that was pre-empted: it is STARTING now."""
        self.adopt(task)
        self._change(S.STARTING, R.NONE, actor=actor, now=now)

    def adopt(self, task: Task) -> None:
        """Take a task on as it is."""
        self.task_id = task.id
        self._executed_before = task.progress.execution_time
        self._resumes_by_itself = False

    def give_up(self) -> None:
        """Let the task go as it is: another takes its place."""
        self.task_id = None
        self.drive.forget()

    def resume(self, seen: VehicleView, *, actor: str, now: float) -> None:
        """Let a PAUSED task start again, from exactly where it was.

        A vehicle that was moved off the task's line meanwhile is not driven back blindly: HELD.
        """
        task = self._active(S.PAUSED)
        if seen.motion is not None and is_off_line(task, seen.motion.pose):
            self._change(S.HELD, R.OFF_TRACK, actor=actor, now=now)
        else:
            self._change(S.STARTING, R.NONE, actor=actor, now=now)

    def release(self, *, again: bool, actor: str, now: float) -> None:
        """Let a HELD task start again: all of it from here, or the remainder."""
        task = self._active(S.HELD)
        progress = task.progress
        if again:
            progress = Progress(execution_time=progress.execution_time)
        elif task.reason in (R.FRAME_RESET, R.OFF_TRACK):
            # its line is lost, or left for good: what was driven counts, where it began does not
            progress = replace(progress, anchor=None, frame=None, target=None, path=())
        self._change(S.STARTING, R.NONE, actor=actor, now=now, progress=progress)

    def set_speed(self, speed: float | None) -> None:
        """Let the active task drive at this speed from now on, m/s; None: as it says itself.

        Of what a plan says and what somebody asks for, the last word counts.
        """
        task = self.task
        if task is None:
            return
        self._registry.note_progress(task.id, replace(task.progress, speed=speed))
        self.drive.set_speed(speed)

    def pause(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Interrupt a task that is being run; does nothing to one that is not."""
        task = self.task
        if task is not None and task.state in (S.STARTING, S.EXECUTING):
            self._lost_until = now
            self._resumes_by_itself = reason in LOSSES
            self._change(S.PAUSED, reason, actor=actor, now=now)
        else:  # no edge PAUSED -> PAUSED: what was lost will not resume by itself any more
            self._resumes_by_itself = False

    def hold(self, reason: TaskReason, *, now: float) -> None:
        """Set a active task aside until somebody decides.

        One of which nothing was driven has no line that could be lost with its frame: a rover that
        boots may find its place while it is being taken.
        """
        task = self.task
        is_starting = task is not None and task.state is S.STARTING and not has_moved(task)
        if reason is R.FRAME_RESET and is_starting:
            return
        if task is not None and task.state in (S.STARTING, S.EXECUTING, S.PAUSED):
            self._change(S.HELD, reason, actor=SERVER, now=now)

    def cancel(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Call the active task off: zeros at once, over when the vehicle stands."""
        task = self.task
        if task is None or task.state is S.CANCELLING:
            return
        if task.state is S.HELD:
            self._finish(S.CANCELLED, reason, actor=actor, now=now)
            return
        self._change(S.CANCELLING, reason, actor=actor, now=now)
        if task.reason in TAKEN:
            self.let_go(actor=actor, now=now)

    def let_go(self, *, actor: str, now: float) -> None:
        """End a task that is being cancelled: somebody else has the vehicle, and it is theirs."""
        task = self._active(S.CANCELLING)
        self._finish(S.CANCELLED, task.reason, actor=actor, now=now)

    def kill(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """End the active task at once; gives its id."""
        killed = self.task_id
        if killed is not None:
            self._finish(S.KILLED, reason, actor=actor, now=now)
        return killed

    @property
    def lost_since(self) -> float | None:
        """Since when, in s, the task has stood that resumes by itself; None: it does not."""
        return self._since if self.resumes_by_itself else None

    @property
    def resumes_by_itself(self) -> bool:
        """Whether it stands only as long as the vehicle, or its position, is not heard of."""
        task = self.task
        return task is not None and task.state is S.PAUSED and self._resumes_by_itself

    # what it wants of the vehicle

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Return what the active task demands of the vehicle; may change its state."""
        task = self.task
        if task is None:
            return view.HOLD
        elapsed = min(now - self._last_tick, 2 * self._settings.watch.setpoint_period)
        self._last_tick = now
        demand = self._step(task, seen, now, elapsed)
        return self.drive.limit(demand, elapsed=elapsed, now=now)

    def _step(self, task: Task, seen: VehicleView, now: float, elapsed: float) -> Demand:
        match task.state:
            case S.STARTING:
                return self._start(task, seen, now)
            case S.EXECUTING:
                return self._execute(task, seen, elapsed, now=now)
            case S.PAUSED:
                self._wait_for_return(seen, now)
            case S.CANCELLING if seen.still:
                self._finish(S.CANCELLED, task.reason, actor=SERVER, now=now)
            case S.CANCELLING if now - self._since > self._settings.watch.stop_unconfirmed:
                self._change(S.HELD, R.STOP_UNCONFIRMED, actor=SERVER, now=now)
                return view.HALT
            case S.HELD if task.reason is R.STOP_UNCONFIRMED and not seen.still:
                is_led = seen.mode in (ModeKind.MANUAL, ModeKind.OTHER)  # by who has it now
                return view.HOLD if is_led else view.HALT
        return view.HOLD

    def begins_again(self, *, now: float) -> bool:
        """The vehicle has restarted: whether the task begins again by itself, having moved nothing.

        It waits until the vehicle is ready, as one does that is submitted a moment later.
        """
        task = self.task
        if task is None or has_moved(task):
            return False
        is_lost = self.resumes_by_itself  # it was silent for a while
        if is_lost:
            self._change(S.STARTING, R.NONE, actor=SERVER, now=now)
        elif task.state is not S.STARTING:
            return False
        self.waits_for = (R.NOT_READY, "it has restarted")
        self._ask_again_at, self._taking_since = None, now
        return True

    def _start(self, task: Task, seen: VehicleView, now: float) -> Demand:
        is_waited_for = now - self._since < self._settings.watch.ready_timeout
        is_not_ready = self.waits_for[0] is R.NOT_READY and is_waited_for and not has_moved(task)
        if is_not_ready and start_blocker(seen, watch=self._settings.watch, now=now):
            self._taking_since = now
            return view.HOLD
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if seen.refusal and seen.is_not_ready and is_waited_for:
            return self._wait_until_ready(task, seen, now)
        if seen.refusal:
            self._finish(S.FAILED, seen.refusal, actor=SERVER, now=now)
            return view.HOLD
        if seen.drives_on:
            self._finish(S.FAILED, R.LOSS_FAILSAFE, actor=SERVER, now=now)
            return view.HOLD
        if not seen.in_control:
            if now - self._taking_since > self._settings.watch.start_timeout:
                self._finish(S.FAILED, R.START_TIMEOUT, actor=SERVER, now=now)
                return view.HOLD
            return view.TAKE
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        creeps = now - self._taking_since > CREEPS_FOR and motion.speed < CREEPS
        if not seen.still and not creeps:  # the heading at the start is that of a vehicle at rest
            if now - self._since > 2 * self._settings.watch.start_timeout:
                self._finish(S.FAILED, R.START_TIMEOUT, actor=SERVER, now=now)
                return view.HOLD
            return view.STAND
        progress = self.drive.begin(task, seen, motion, now=now)
        if isinstance(progress, Becomes):
            return self._becomes(progress, now=now)
        self._change(S.EXECUTING, R.NONE, actor=SERVER, now=now, progress=progress)
        return view.STAND

    def _execute(self, task: Task, seen: VehicleView, elapsed: float, *, now: float) -> Demand:
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if not seen.in_control:
            if now - self._taking_since > self._settings.watch.start_timeout:
                self._finish(S.FAILED, R.START_TIMEOUT, actor=SERVER, now=now)
                return view.HOLD
            return view.TAKE
        self._taking_since = now
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        executed = self._executed_before + now - self._since
        outcome = self.drive.go_on(task, seen, motion, executed=executed, elapsed=elapsed, now=now)
        return self._becomes(outcome, now=now) if isinstance(outcome, Becomes) else outcome

    def _becomes(self, outcome: Becomes, *, now: float) -> Demand:
        """Record what is to become of the task: it stands."""
        state, reason = outcome
        if state in TERMINAL:
            self._finish(state, reason, actor=SERVER, now=now)
        elif state is S.PAUSED:
            self.pause(reason, actor=SERVER, now=now)
        else:
            self._change(state, reason, actor=SERVER, now=now)
        return view.HOLD

    def _wait_until_ready(self, task: Task, seen: VehicleView, now: float) -> Demand:
        """The vehicle would not arm: stand by, and have it asked again after a while."""
        words = seen.why_not_ready
        if self._ask_again_at is None:  # a try has just ended: what it was refused with is told
            self._ask_again_at = now + ASK_AGAIN
            if self.waits_for != (R.NOT_READY, words):
                self._registry.record(TaskWaits(task.id, task.vehicle, R.NOT_READY, now, words))
        self.waits_for = (R.NOT_READY, words)
        if now < self._ask_again_at:
            return view.STAND
        self._ask_again_at, self._taking_since = None, now
        return view.TAKE

    def _pause_if_lost(self, seen: VehicleView, now: float) -> bool:
        """Interrupt when heartbeats or position are missing; whether it did."""
        lost, motion = R.NONE, seen.motion
        if not seen.heard:
            lost = R.LINK_LOST
        elif motion is None or now - motion.at > self._settings.watch.position_lost:
            lost = R.POSITION_LOST
        if lost:
            self._lost_at, self._was_silent = None if motion is None else motion.pose, False
            self._untaken_in = seen.mode if seen.is_untouched and not seen.armed else None
            self.pause(lost, actor=SERVER, now=now)
        return bool(lost)

    def _wait_for_return(self, seen: VehicleView, now: float) -> None:
        """A task PAUSED by a loss resumes by itself after a while of good data, or fails."""
        if not self._resumes_by_itself:
            return
        watch = self._settings.watch
        if now - self._since > watch.lost_timeout:
            self._finish(S.FAILED, R.LINK_TIMEOUT, actor=SERVER, now=now)
            return
        self._was_silent |= not seen.heard
        if seen.armed:
            ours = seen.mode in (ModeKind.OURS, ModeKind.HOLD)
        else:  # as it was when it was lost, before it could be taken
            ours = seen.mode is self._untaken_in
        task = self._active(S.PAUSED)
        if not ours or start_blocker(seen, watch=watch, now=now, goal=goal_of(task)):
            self._lost_until = now
        elif now - self._lost_until >= watch.fresh_before_resume:
            there, here = self._lost_at if self._was_silent else None, seen.motion
            if there is not None and here is not None and was_handled(task, there, here.pose):
                self._change(S.HELD, R.OFF_TRACK, actor=SERVER, now=now)
            else:
                self.resume(seen, actor=SERVER, now=now)

    # states

    def _active(self, state: TaskState) -> Task:
        task = self.task
        assert task is not None, "nothing has begun here"
        assert task.state is state, f"task {task.id} is not {state.name}"
        return task

    def _change(
        self,
        new: TaskState,
        reason: TaskReason,
        *,
        actor: str,
        now: float,
        progress: Progress | None = None,
    ) -> None:
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
            self.task_id,
            new,
            reason=reason,
            actor=actor,
            now=now,
            progress=progress,
            timing=timing,
        )
        if new is S.EXECUTING:
            period = self._settings.watch.setpoint_period
            self._meter = TimingMeter(period=period, before=old.timing)

    def _finish(self, state: TaskState, reason: TaskReason, *, actor: str, now: float) -> None:
        self._change(state, reason, actor=actor, now=now)
        self.give_up()
