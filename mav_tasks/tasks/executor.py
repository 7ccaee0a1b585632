"""Runs the one begun task of a vehicle: from STARTING to its end, through every interruption.

It asks for nothing but demands (``view``) and changes states through the book only. Its first
non-zero velocity waits until EXECUTING is durable; zeros never wait.
"""

from dataclasses import replace

from mav_tasks.settings import Settings
from mav_tasks.tasks import view
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.course import Course
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.goal import Face, GoTo, Wait
from mav_tasks.tasks.guidance import ZERO, Motion
from mav_tasks.tasks.legs import anchor_of, begun_from, distance
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.limits import limited
from mav_tasks.tasks.scheduler import place_of, start_blocker
from mav_tasks.tasks.stuck import StuckWatch
from mav_tasks.tasks.task import Progress, Task, TaskId
from mav_tasks.tasks.view import Demand, DemandKind, ModeKind, VehicleView
from mav_tasks.tasks.way_back import is_off_line, resumed, way_back

S, R = TaskState, TaskReason

#: interruptions that end by themselves when the vehicle is back
LOSSES = frozenset({R.LINK_LOST, R.POSITION_LOST})


class Executor:
    """The begun task of one vehicle, if there is one."""

    def __init__(self, book: TaskBook, settings: Settings) -> None:
        self._book = book
        self._settings = settings
        self._task_id: TaskId | None = None
        self._course: Course | None = None  # while EXECUTING
        self._way_back: Course | None = None  # driven before it
        self._since = 0.0  # when the present state was entered
        self._executed_before = 0.0  # s of EXECUTING in earlier stretches
        self._last_velocity = ZERO
        self._last_tick = 0.0
        self._moved_at = 0.0  # when a velocity other than zero was last asked for
        self._stuck = StuckWatch()
        self._lost_until = 0.0  # while PAUSED by a loss: when data was last not good
        self._resumes_by_itself = False
        #: m/s, overrides what the task says (DO_CHANGE_SPEED); for this task only
        self.speed: float | None = None

    def __repr__(self) -> str:
        return f"Executor({self.task!r})"

    @property
    def task(self) -> Task | None:
        """The begun task."""
        return None if self._task_id is None else self._book[self._task_id]

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings

    # what others want of it

    def begin(self, task: Task, *, actor: str, now: float) -> None:
        """Take a queued task on, or one that was pre-empted: it is STARTING now."""
        self.adopt(task)
        self._change(S.STARTING, R.NONE, actor=actor, now=now)

    def adopt(self, task: Task) -> None:
        """Take a task on as it is."""
        self._task_id = task.id
        self._executed_before = task.progress.execution_time
        self._resumes_by_itself = False
        self.speed = None

    def give_up(self) -> None:
        """Let the task go as it is: another takes its place."""
        self._task_id = None
        self._course = self._way_back = None

    def resume(self, seen: VehicleView, *, actor: str, now: float) -> None:
        """Let a PAUSED task start again, from exactly where it was.

        A vehicle that was moved off the task's line meanwhile is not driven back blindly: HELD.
        """
        task = self._begun(S.PAUSED)
        if seen.motion is not None and is_off_line(task, seen.motion.pose):
            self._change(S.HELD, R.OFF_LINE, actor=actor, now=now)
        else:
            self._change(S.STARTING, R.NONE, actor=actor, now=now)

    def release(self, *, again: bool, actor: str, now: float) -> None:
        """Let a HELD task start again: all of it from here, or the remainder."""
        task = self._begun(S.HELD)
        progress = task.progress
        if again:
            progress = Progress(execution_time=progress.execution_time)
        elif task.reason in (R.FRAME_RESET, R.OFF_LINE):
            # its line is lost, or left for good: what was driven counts, where it began does not
            progress = replace(progress, anchor=None, frame=None, target=None)
        self._change(S.STARTING, R.NONE, actor=actor, now=now, progress=progress)

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
        """Set a begun task aside until somebody decides."""
        task = self.task
        if task is not None and task.state in (S.STARTING, S.EXECUTING, S.PAUSED):
            self._change(S.HELD, reason, actor=SERVER, now=now)

    def cancel(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Call the begun task off: zeros at once, over when the vehicle stands."""
        task = self.task
        if task is None or task.state is S.CANCELLING:
            return
        if task.state is S.HELD:
            self._finish(S.CANCELLED, reason, actor=actor, now=now)
            return
        self._change(S.CANCELLING, reason, actor=actor, now=now)
        if task.reason is R.TAKEOVER:
            self.let_go(actor=actor, now=now)

    def let_go(self, *, actor: str, now: float) -> None:
        """End a task that is being cancelled: somebody else has the vehicle, and it is theirs."""
        task = self._begun(S.CANCELLING)
        self._finish(S.CANCELLED, task.reason, actor=actor, now=now)

    def kill(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """End the begun task at once; gives its id."""
        killed = self._task_id
        if killed is not None:
            self._finish(S.KILLED, reason, actor=actor, now=now)
        return killed

    # what it wants of the vehicle

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Give what the begun task demands of the vehicle; may change its state."""
        task = self.task
        if task is None:
            return view.HOLD
        elapsed = min(now - self._last_tick, 2 * self._settings.watch.setpoint_period)
        self._last_tick = now
        demand = self._step(task, seen, now, elapsed)
        if demand.kind is not DemandKind.DRIVE:
            self._last_velocity = ZERO
            return demand
        self._last_velocity = limited(
            demand.velocity, self._last_velocity, driving=self._settings.driving, elapsed=elapsed
        )
        if not self._last_velocity.is_zero:
            self._moved_at = now
        self._stuck.commanded(self._last_velocity, seconds=self._settings.watch.setpoint_period)
        return Demand(DemandKind.DRIVE, self._last_velocity)

    def _step(self, task: Task, seen: VehicleView, now: float, elapsed: float) -> Demand:
        match task.state:
            case S.STARTING:
                return self._start(task, seen, now)
            case S.EXECUTING:
                return self._execute(task, seen, now, elapsed)
            case S.PAUSED:
                self._wait_for_return(seen, now)
            case S.CANCELLING if seen.still:
                self._finish(S.CANCELLED, task.reason, actor=SERVER, now=now)
            case S.CANCELLING if now - self._since > self._settings.watch.stop_unconfirmed:
                self._change(S.HELD, R.STOP_UNCONFIRMED, actor=SERVER, now=now)
                return view.HALT
            case S.HELD if task.reason is R.STOP_UNCONFIRMED and not seen.still:
                return view.HALT
        return view.HOLD

    def _start(self, task: Task, seen: VehicleView, now: float) -> Demand:
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if seen.refusal:
            self._finish(S.FAILED, seen.refusal, actor=SERVER, now=now)
            return view.HOLD
        if not seen.in_control:
            if now - self._since > self._settings.watch.start_timeout:
                self._finish(S.FAILED, R.START_TIMEOUT, actor=SERVER, now=now)
                return view.HOLD
            return view.TAKE
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        if not seen.still:  # the heading at the start is that of a vehicle at rest
            if now - self._since > 2 * self._settings.watch.start_timeout:
                self._finish(S.FAILED, R.START_TIMEOUT, actor=SERVER, now=now)
                return view.HOLD
            return view.STAND
        progress = _begun(task, seen, motion)
        if progress is None:
            self.pause(R.POSITION_LOST, actor=SERVER, now=now)
            return view.HOLD
        longest = self._settings.driving.max_distance
        if progress.target is not None and distance(motion.pose, progress.target) > longest:
            self._finish(S.FAILED, R.BAD_PARAMETER, actor=SERVER, now=now)
            return view.HOLD
        self._course = Course(task.goal, progress)
        self._way_back = way_back(task.goal, progress, motion) if task.progress.anchor else None
        self._stuck.begin(now=now)
        self._change(S.EXECUTING, R.NONE, actor=SERVER, now=now, progress=progress)
        return view.STAND

    def _execute(self, task: Task, seen: VehicleView, now: float, elapsed: float) -> Demand:
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if not seen.in_control:
            return view.TAKE
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        course = self._way_back or self._course
        assert course is not None, "EXECUTING begins by setting the course"
        is_held_back = not self._book.is_durable(task.id)
        course.look(motion, elapsed=0.0 if is_held_back else elapsed)
        self._note_progress(task, now)
        stands = seen.still and self._has_asked_to_stand(now)
        if course.has_arrived(stands=stands, driving=self._settings.driving):
            if stands or isinstance(course.leg, Wait):
                self._arrive(course, motion, now)
            return view.STAND
        if is_held_back:
            self._stuck.begin(now=now)
            return view.STAND
        if self._stuck.is_stuck(course, seen, limit=self._settings.watch.stuck, now=now):
            self._finish(S.FAILED, R.STUCK, actor=SERVER, now=now)
            return view.HOLD
        speed = None if course is self._way_back else self.speed
        velocity = course.steer(motion, driving=self._settings.driving, speed=speed)
        return Demand(DemandKind.DRIVE, velocity)

    def _arrive(self, course: Course, motion: Motion, now: float) -> None:
        """The end of a leg: the next one, back to the task itself, or all done."""
        assert self._task_id is not None
        self._stuck.begin(now=now)
        if course.advance(motion):
            if course is self._course:
                self._book.advance(self._task_id, course.progress, now=now)
        elif course is self._way_back:
            self._way_back = None
        else:
            self._finish(S.COMPLETED, R.NONE, actor=SERVER, now=now)

    def _has_asked_to_stand(self, now: float) -> bool:
        """Whether zeros have been asked for long enough to call slowness a standstill."""
        return now - self._moved_at >= self._settings.watch.still_time

    def _pause_if_lost(self, seen: VehicleView, now: float) -> bool:
        """Interrupt when heartbeats or position are missing; whether it did."""
        if not seen.heard:
            self.pause(R.LINK_LOST, actor=SERVER, now=now)
            return True
        if seen.motion is None or now - seen.motion.at > self._settings.watch.position_lost:
            self.pause(R.POSITION_LOST, actor=SERVER, now=now)
            return True
        return False

    def _wait_for_return(self, seen: VehicleView, now: float) -> None:
        """A task PAUSED by a loss resumes by itself after a while of good data, or fails."""
        if not self._resumes_by_itself:
            return
        watch = self._settings.watch
        if now - self._since > watch.lost_timeout:
            self._finish(S.FAILED, R.LINK_TIMEOUT, actor=SERVER, now=now)
            return
        ours = seen.mode in (ModeKind.OURS, ModeKind.HOLD) and seen.armed
        if not ours or start_blocker(seen, watch=watch, now=now):
            self._lost_until = now
        elif now - self._lost_until >= watch.fresh_before_resume:
            self.resume(seen, actor=SERVER, now=now)

    def _note_progress(self, task: Task, now: float) -> None:
        assert self._course is not None
        executed = self._executed_before + now - self._since
        self._course.progress = replace(self._course.progress, execution_time=executed)
        self._book.note_progress(task.id, self._course.progress)

    # states

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
        if old.state is S.EXECUTING:
            self._executed_before += now - self._since
            progress = replace(old.progress, execution_time=self._executed_before)
        self._since = now
        self._book.change(
            self._task_id, new, reason=reason, actor=actor, now=now, progress=progress
        )

    def _finish(self, state: TaskState, reason: TaskReason, *, actor: str, now: float) -> None:
        self._change(state, reason, actor=actor, now=now)
        self.give_up()


def _begun(task: Task, seen: VehicleView, motion: Motion) -> Progress | None:
    """Give the progress with which a task goes on, or begins, here; None: its place is unknown."""
    goal, progress = task.goal, task.progress
    if progress.anchor is not None:
        return resumed(goal, progress, motion)
    target = place_of(goal, seen) if isinstance(goal, GoTo) else None
    if isinstance(goal, GoTo) and target is None:
        return None
    done = 0.0 if isinstance(goal, GoTo | Face) else progress.done  # these mean a place, or a way
    anchor = begun_from(goal, anchor_of(goal, 0, motion.pose, target), done)
    return replace(progress, anchor=anchor, target=target, frame=seen.frame, leg=0, done=done)
