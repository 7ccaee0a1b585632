"""Runs the one begun task of a vehicle: from STARTING to its end, through every interruption.

It asks for nothing but demands (``view``) and changes states through the book only. Its first
non-zero velocity waits until EXECUTING is durable; zeros never wait.
"""

from dataclasses import replace
from math import inf

from mav_tasks.settings import Settings
from mav_tasks.tasks import guidance, view
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.guidance import ZERO, Motion, Velocity
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.limits import limited
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.task import Move, Pose, Progress, Task, TaskId
from mav_tasks.tasks.view import Demand, DemandKind, ModeKind, VehicleView

OFF_LINE = 1.0  # m, lifecycle: further off its line than this is no resumption
JUMP = 2.0  # m, a position that moved further than the vehicle can have driven
PROGRESS = 0.02  # m or rad, less than this in the stuck time is no progress
BLIND = 1.0  # m or rad towards the goal commanded without progress: the same, but sooner

MOVING_TOLERANCE = 0.4  # of the tolerance: zero is asked for nearer to the end than is required

#: interruptions that end by themselves when the vehicle is back
LOSSES = frozenset({TaskReason.LINK_LOST, TaskReason.POSITION_LOST})


class Executor:
    """The begun task of one vehicle, if there is one."""

    def __init__(self, book: TaskBook, settings: Settings) -> None:
        self._book = book
        self._settings = settings
        self._task_id: TaskId | None = None
        self._since = 0.0  # when the present state was entered
        self._executed_before = 0.0  # s of EXECUTING in earlier stretches
        self._last_motion: Motion | None = None
        self._last_velocity = ZERO
        self._last_tick = 0.0
        self._moved_at = 0.0  # when a velocity other than zero was last asked for
        self._best_remaining = inf
        self._progress_at = 0.0
        self._commanded = 0.0  # m or rad, since the last progress
        self._lost_until = 0.0  # while PAUSED by a loss: when data was last not good

    def __repr__(self) -> str:
        return f"Executor({self.task!r})"

    @property
    def task(self) -> Task | None:
        """The begun task."""
        return None if self._task_id is None else self._book[self._task_id]

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings

    def begin(self, task: Task, *, actor: str, now: float) -> None:
        """Take a queued task on: it is STARTING now."""
        self._task_id = task.id
        self._executed_before = task.progress.execution_time
        self._change(TaskState.STARTING, TaskReason.NONE, actor=actor, now=now)

    def resume(self, seen: VehicleView, *, actor: str, now: float) -> None:
        """Let a PAUSED task start again, from exactly where it was.

        A vehicle that was moved off the task's line meanwhile is not driven back blindly: HELD.
        """
        task = self._begun(TaskState.PAUSED)
        if seen.motion is not None and _is_off_line(task, seen.motion.pose):
            self._change(TaskState.HELD, TaskReason.OFF_LINE, actor=actor, now=now)
        else:
            self._change(TaskState.STARTING, TaskReason.NONE, actor=actor, now=now)

    def pause(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Interrupt a task that is being run; does nothing to one that is not."""
        task = self.task
        if task is not None and task.state in (TaskState.STARTING, TaskState.EXECUTING):
            self._lost_until = now
            self._change(TaskState.PAUSED, reason, actor=actor, now=now)
        elif task is not None and task.state is TaskState.PAUSED and task.reason in LOSSES:
            # no edge PAUSED -> PAUSED: it will not resume by itself, because its queue is paused
            self._lost_until = inf

    def hold(self, reason: TaskReason, *, now: float) -> None:
        """Set a begun task aside until somebody decides."""
        task = self.task
        if task is not None and task.state in (
            TaskState.STARTING,
            TaskState.EXECUTING,
            TaskState.PAUSED,
        ):
            self._change(TaskState.HELD, reason, actor=SERVER, now=now)

    def kill(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """End the begun task at once; gives its id."""
        killed = self._task_id
        if killed is not None:
            self._finish(TaskState.KILLED, reason, actor=actor, now=now)
        return killed

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Give what the begun task demands of the vehicle; may change its state."""
        task = self.task
        if task is None:
            return view.HOLD
        demand = self._step(task, seen, now)
        elapsed = now - self._last_tick
        self._last_tick = now
        if demand.kind is not DemandKind.DRIVE:
            self._last_velocity = ZERO
            return demand
        self._last_velocity = limited(
            demand.velocity,
            self._last_velocity,
            driving=self._settings.driving,
            elapsed=min(elapsed, 2 * self._settings.watch.setpoint_period),
        )
        if not self._last_velocity.is_zero:
            self._moved_at = now
            wish = self._last_velocity
            rate = wish.forward if isinstance(task.goal, Move) else wish.yaw_rate
            self._commanded += self._settings.watch.setpoint_period * abs(rate)
        return Demand(DemandKind.DRIVE, self._last_velocity)

    def _step(self, task: Task, seen: VehicleView, now: float) -> Demand:
        match task.state:
            case TaskState.STARTING:
                return self._start(task, seen, now)
            case TaskState.EXECUTING:
                return self._execute(task, seen, now)
            case TaskState.PAUSED if self._has_jumped(seen):
                self._change(TaskState.HELD, TaskReason.FRAME_RESET, actor=SERVER, now=now)
            case TaskState.PAUSED:
                self._wait_for_return(task, seen, now)
            case TaskState.CANCELLING if seen.still:
                self._finish(TaskState.CANCELLED, task.reason, actor=SERVER, now=now)
        return view.HOLD

    def _start(self, task: Task, seen: VehicleView, now: float) -> Demand:
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if seen.refusal:
            self._finish(TaskState.FAILED, seen.refusal, actor=SERVER, now=now)
            return view.HOLD
        if not seen.in_control:
            if now - self._since > self._settings.watch.start_timeout:
                self._finish(TaskState.FAILED, TaskReason.START_TIMEOUT, actor=SERVER, now=now)
                return view.HOLD
            return view.TAKE
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        if not seen.still:  # the heading at the start is that of a vehicle at rest
            return view.STAND
        if self._has_jumped(seen):
            self._change(TaskState.HELD, TaskReason.FRAME_RESET, actor=SERVER, now=now)
            return view.HOLD
        anchor = task.progress.anchor or motion.pose
        self._best_remaining = inf
        self._change(
            TaskState.EXECUTING,
            TaskReason.NONE,
            actor=SERVER,
            now=now,
            progress=replace(task.progress, anchor=anchor),
        )
        return view.STAND

    def _execute(self, task: Task, seen: VehicleView, now: float) -> Demand:
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if not seen.in_control:
            return view.TAKE
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        if self._has_jumped(seen):
            self._change(TaskState.HELD, TaskReason.FRAME_RESET, actor=SERVER, now=now)
            return view.HOLD
        task = self._note_progress(task, motion.pose, now)
        signed_remaining = task.length - task.progress.done
        stands = seen.still and self._has_asked_to_stand(now)
        if self._has_arrived(task, signed_remaining, stands=stands):
            if stands:
                self._finish(TaskState.COMPLETED, TaskReason.NONE, actor=SERVER, now=now)
            return view.STAND
        if not self._book.is_durable(task.id):
            self._progress_at = now
            return view.STAND
        if self._is_stuck(signed_remaining, now):
            self._finish(TaskState.FAILED, TaskReason.STUCK, actor=SERVER, now=now)
            return view.HOLD
        return Demand(DemandKind.DRIVE, self._steer(task, motion, signed_remaining))

    def _has_arrived(self, task: Task, signed_remaining: float, *, stands: bool) -> bool:
        """Whether to stand here: near the end while moving; anywhere within tolerance at rest."""
        within = 1.0 if stands else MOVING_TOLERANCE
        return guidance.has_arrived(
            task.goal, signed_remaining, within=within, driving=self._settings.driving
        )

    def _has_asked_to_stand(self, now: float) -> bool:
        """Whether zeros have been asked for long enough to call slowness a standstill."""
        return now - self._moved_at >= self._settings.watch.still_time

    def _steer(self, task: Task, motion: Motion, signed_remaining: float) -> Velocity:
        anchor = task.progress.anchor
        assert anchor is not None, "EXECUTING begins by setting the anchor"
        return guidance.steer(
            task.goal,
            anchor,
            motion.pose,
            remaining=signed_remaining,
            driving=self._settings.driving,
        )

    def _pause_if_lost(self, seen: VehicleView, now: float) -> bool:
        """Interrupt when heartbeats or position are missing; whether it did."""
        if not seen.heard:
            self.pause(TaskReason.LINK_LOST, actor=SERVER, now=now)
            return True
        if seen.motion is None or now - seen.motion.at > self._settings.watch.position_lost:
            self.pause(TaskReason.POSITION_LOST, actor=SERVER, now=now)
            return True
        return False

    def _wait_for_return(self, task: Task, seen: VehicleView, now: float) -> None:
        """A task PAUSED by a loss resumes by itself after a while of good data, or fails."""
        if task.reason not in LOSSES or self._lost_until == inf:
            return
        watch = self._settings.watch
        if now - self._since > watch.lost_timeout:
            self._finish(TaskState.FAILED, TaskReason.LINK_TIMEOUT, actor=SERVER, now=now)
            return
        ours = seen.mode in (ModeKind.OURS, ModeKind.HOLD) and seen.armed
        if not ours or start_blocker(seen, watch=watch, now=now):
            self._lost_until = now
        elif now - self._lost_until >= watch.fresh_before_resume:
            self.resume(seen, actor=SERVER, now=now)

    def _note_progress(self, task: Task, pose: Pose, now: float) -> Task:
        anchor = task.progress.anchor
        assert anchor is not None, "EXECUTING begins by setting the anchor"
        self._book.note_progress(
            task.id,
            Progress(
                anchor=anchor,
                done=guidance.done_so_far(task.goal, anchor, pose, before=task.progress.done),
                execution_time=self._executed_before + now - self._since,
            ),
        )
        return self._book[task.id]

    def _has_jumped(self, seen: VehicleView) -> bool:
        """Whether the position moved further since the last look than a vehicle can drive."""
        last, motion = self._last_motion, seen.motion
        if motion is None:
            return False
        self._last_motion = motion
        if last is None:
            return False
        elapsed = max(0.0, motion.at - last.at)
        north = motion.pose.north - last.pose.north
        east = motion.pose.east - last.pose.east
        reach = JUMP + 2 * self._settings.driving.max_speed * elapsed
        return north * north + east * east > reach * reach

    def _is_stuck(self, signed_remaining: float, now: float) -> bool:
        if abs(signed_remaining) < self._best_remaining - PROGRESS:
            self._best_remaining = abs(signed_remaining)
            self._progress_at = now
            self._commanded = 0.0
        return now - self._progress_at > self._settings.watch.stuck or self._commanded > BLIND

    def _begun(self, state: TaskState) -> Task:
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
        assert self._task_id is not None
        old = self._book[self._task_id]
        if old.state is TaskState.EXECUTING:
            self._executed_before += now - self._since
            progress = replace(old.progress, execution_time=self._executed_before)
        self._since = now
        self._book.change(
            self._task_id, new, reason=reason, actor=actor, now=now, progress=progress
        )

    def _finish(self, state: TaskState, reason: TaskReason, *, actor: str, now: float) -> None:
        self._change(state, reason, actor=actor, now=now)
        self._task_id = None
        self._last_motion = None


def _is_off_line(task: Task, pose: Pose) -> bool:
    """Whether a paused move cannot simply go on from here."""
    anchor = task.progress.anchor
    if anchor is None or not isinstance(task.goal, Move):
        return False
    along = guidance.done_so_far(task.goal, anchor, pose, before=task.progress.done)
    return abs(guidance.cross_track(anchor, pose)) > OFF_LINE or along > task.length + OFF_LINE
