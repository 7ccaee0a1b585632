"""Runs the one begun task of a vehicle: from STARTING to its end, through every interruption.

It asks for nothing but demands (``view``) and changes states through the book only. Its first
non-zero velocity waits until EXECUTING is durable; zeros never wait.
"""

from dataclasses import replace
from math import copysign

from mav_tasks.settings import Driving, Settings
from mav_tasks.tasks import view
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.driving.arrival import Arrival
from mav_tasks.tasks.driving.astray import AstrayWatch
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.course import Course
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity
from mav_tasks.tasks.driving.itinerary import following, goal_of, is_over, present_goal, skipped_to
from mav_tasks.tasks.driving.legs import distance
from mav_tasks.tasks.driving.limits import limited, within_fence
from mav_tasks.tasks.driving.path import Follow
from mav_tasks.tasks.driving.stage import (
    course_of,
    look_on_the_way,
    may_go_on_rolling,
    set_out,
    steering_of,
)
from mav_tasks.tasks.driving.stuck import Follows, StuckWatch
from mav_tasks.tasks.driving.way_back import is_off_line, way_back
from mav_tasks.tasks.events import SERVER, TaskWaits, VehicleNoted
from mav_tasks.tasks.goal import Face, Move, MoveTurned, Near, Plan, Rotate, Wait
from mav_tasks.tasks.lifecycle import LOSSES, TAKEN, TaskReason, TaskState
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.task import Progress, Task, TaskId
from mav_tasks.tasks.timing import Timing, TimingMeter
from mav_tasks.tasks.view import Demand, DemandKind, ModeKind, VehicleView

S, R = TaskState, TaskReason

#: m/s and s after which a vehicle that creeps on zeros is driven: a speed loop that has wound up on
#: the estimate's offset may never let it stand (PX4, RO_SPEED_I 0.5)
CREEPS, CREEPS_FOR = 0.3, 6.0
#: times that a vehicle may drive past a place that its turning circle keeps it from
MISSES = 3
ASK_AGAIN = 4.0  # s, from the end of a try to arm to the next one, while a vehicle is not ready
KEEP_EACH = 1.0  # s between two writes of the progress of a task that is being driven
#: interruptions that end by themselves when the vehicle is back


def has_moved(task: Task) -> bool:
    """Return whether anything of a task may have been driven."""
    return task.progress.anchor is not None or task.progress.execution_time > 0.0


class Executor:
    """The begun task of one vehicle, if there is one."""

    def __init__(self, book: TaskBook, settings: Settings, bounds: Bounds) -> None:
        self._book = book
        self._bounds = bounds
        self._settings = settings
        self._task_id: TaskId | None = None
        #: m/s, of tasks that are driven as the vehicle itself would; None: as the settings say
        self.cruise: float | None = None
        self._course: Course | None = None  # while EXECUTING
        self._way_back: Course | None = None  # driven before it
        self._since = 0.0  # when the present state was entered
        self._executed_before = 0.0  # s of EXECUTING in earlier stretches
        self._last_velocity = ZERO
        self._last_tick = 0.0
        self._moved_at = 0.0  # when a velocity other than zero was last asked for
        self._stuck = StuckWatch()
        self._follows = Follows()
        self._astray = AstrayWatch()
        self._arrival = Arrival()
        self._lost_until = 0.0  # while PAUSED by a loss: when data was last not good
        self._resumes_by_itself = False
        self._is_coming_back = False  # from outside the fence
        self._meter: TimingMeter | None = None  # while EXECUTING
        self._taking_since = 0.0  # while STARTING
        self._ask_again_at: float | None = None  # while the vehicle is not ready, between two tries
        #: what a STARTING task waits for, and that in the vehicle's own words
        self.waits_for: tuple[TaskReason, str] = (R.NONE, "")
        self._kept_at = 0.0  # when progress was last given to the store
        self._kept_as = 0  # the number of that event

    def __repr__(self) -> str:
        return f"Executor({self.task!r})"

    @property
    def task(self) -> Task | None:
        """The begun task."""
        return None if self._task_id is None else self._book[self._task_id]

    @property
    def timing(self) -> Timing | None:
        """How evenly the begun task's setpoints have left up to now."""
        measured = None if self._meter is None else self._meter.timing()
        return measured or (None if self.task is None else self.task.timing)

    def setpoint_left(self, *, now: float) -> None:
        """A setpoint leaves for the vehicle now."""
        if self._meter is not None:
            self._meter.note(now=now)

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
            progress = replace(progress, anchor=None, frame=None, target=None, path=())
        self._change(S.STARTING, R.NONE, actor=actor, now=now, progress=progress)

    def set_speed(self, speed: float | None) -> None:
        """Let the begun task drive at this speed from now on, m/s; None: as it says itself.

        Of what a plan says and what somebody asks for, the last word counts.
        """
        task = self.task
        if task is None:
            return
        self._book.note_progress(task.id, replace(task.progress, speed=speed))
        if self._course is not None:
            self._course.progress = replace(self._course.progress, speed=speed)

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
        """Set a begun task aside until somebody decides.

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
        """Call the begun task off: zeros at once, over when the vehicle stands."""
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
        task = self._begun(S.CANCELLING)
        self._finish(S.CANCELLED, task.reason, actor=actor, now=now)

    def kill(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """End the begun task at once; gives its id."""
        killed = self._task_id
        if killed is not None:
            self._finish(S.KILLED, reason, actor=actor, now=now)
        return killed

    @property
    def resumes_by_itself(self) -> bool:
        """Whether it stands only as long as the vehicle, or its position, is not heard of."""
        task = self.task
        return task is not None and task.state is S.PAUSED and self._resumes_by_itself

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
        self._astray.commanded(self._last_velocity)
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
        progress = self._set_out(task, task.progress, seen, motion, now=now)
        if progress is None:
            return view.HOLD
        self._way_back, self._astray = None, AstrayWatch()
        if task.progress.anchor is not None:
            goal, honours = present_goal(task.goal, progress), seen.honours_yaw_rate
            self._way_back = way_back(
                goal,
                progress,
                motion,
                honours_yaw_rate=honours,
                steering=steering_of(seen, self._bounds),
            )
        self._change(S.EXECUTING, R.NONE, actor=SERVER, now=now, progress=progress)
        return view.STAND

    def _wait_until_ready(self, task: Task, seen: VehicleView, now: float) -> Demand:
        """The vehicle would not arm: stand by, and have it asked again after a while."""
        words = seen.why_not_ready
        if self._ask_again_at is None:  # a try has just ended: what it was refused with is told
            self._ask_again_at = now + ASK_AGAIN
            if self.waits_for != (R.NOT_READY, words):
                self._book.record(TaskWaits(task.id, task.vehicle, R.NOT_READY, now, words))
        self.waits_for = (R.NOT_READY, words)
        if now < self._ask_again_at:
            return view.STAND
        self._ask_again_at, self._taking_since = None, now
        return view.TAKE

    def _set_out(
        self, task: Task, progress: Progress, seen: VehicleView, motion: Motion, *, now: float
    ) -> Progress | None:
        """Set the course of a stage that begins here; None: it cannot, the task is interrupted."""
        steering = steering_of(seen, self._bounds)
        if steering is not None and isinstance(
            present_goal(task.goal, progress), Rotate | Face | MoveTurned
        ):
            self._finish(S.FAILED, R.NOT_SUPPORTED_BY_VEHICLE, actor=SERVER, now=now)
            return None
        here = set_out(task.goal, progress, seen, motion, steering=steering)
        if here is None:
            self.pause(R.POSITION_LOST, actor=SERVER, now=now)
            return None
        longest = self._settings.driving.max_distance
        if here.target is not None and distance(motion.pose, here.target) > longest:
            self._finish(S.FAILED, R.BAD_PARAMETER, actor=SERVER, now=now)
            return None
        if not self._bounds.allows_stage(
            present_goal(task.goal, here), here, motion.pose, seen.origin
        ):
            self._refuse_stage(task, now=now)
            return None
        self._is_coming_back = not self._bounds.allows(motion.pose, seen.origin)
        driving = self._settings.driving
        self._course = course_of(task.goal, here, seen, driving=driving, steering=steering)
        self._begin_leg(now=now)
        return here

    def _refuse_stage(self, task: Task, *, now: float) -> None:
        """The way leads over the fence: nothing of it is driven."""
        if task.progress.anchor is None and task.progress.step < 0:
            self._finish(S.FAILED, R.OUTSIDE_FENCE, actor=SERVER, now=now)
        else:
            self._change(S.HELD, R.FENCE, actor=SERVER, now=now)

    def _execute(self, task: Task, seen: VehicleView, now: float, elapsed: float) -> Demand:
        if self._pause_if_lost(seen, now):
            return view.HOLD
        if not seen.in_control:
            return view.TAKE
        motion = seen.motion
        if motion is None or now - motion.at > self._settings.watch.motion_fresh:
            return view.STAND
        if self._course is None:  # another step is gone on with
            steering = steering_of(seen, self._bounds)
            if not seen.still and not may_go_on_rolling(
                task.goal, task.progress, seen, motion, steering=steering
            ):
                return view.STAND
            if not self._go_on(task, task.progress, seen, motion, now=now):
                return view.HOLD
        course = self._way_back or self._course
        assert course is not None, "EXECUTING begins by setting the course"
        is_held_back = not self._book.is_durable(task.id)
        elapsed = 0.0 if is_held_back else elapsed
        course.look(motion, elapsed=elapsed)
        if isinstance(task.goal, Plan) and course is self._course and not is_held_back:
            self._look_on_the_way(task, task.goal, course, motion, elapsed=elapsed, now=now)
            if course.has_passed(motion):
                after = self._leave_step(task, task.goal, now=now)
                if after is None:
                    return view.HOLD
                self._book.note_progress(task.id, after)
                self._course = None
                return Demand(DemandKind.DRIVE, self._last_velocity)
        self._note_progress(task, now)
        stands = seen.still and self._has_asked_to_stand(now)
        if self._arrival.stands_here(
            course,
            motion,
            self._last_velocity,
            stands=stands,
            driving=self._settings.driving,
            now=now,
        ):
            if stands or isinstance(course.leg, Wait):
                self._arrive(task, course, seen, motion, now)
            return view.STAND
        if is_held_back:
            self._stuck.begin(now=now)
            return view.STAND
        if self._stuck.is_stuck(course, seen, limit=self._settings.watch.stuck, now=now):
            self._finish(S.FAILED, R.STUCK, actor=SERVER, now=now)
            return view.HOLD
        period = self._settings.watch.setpoint_period
        news = self._follows.look(self._last_velocity, motion, seconds=period, now=now)
        if news:
            self._book.record(VehicleNoted(task.vehicle, news, now))
        if self._astray.is_astray(course, motion):
            self._set_aside_as_astray(task, now=now)
            return view.HOLD
        speed = None if course is self._way_back else course.progress.speed
        driving, slowest = self._driving_of(task), self._arrival.slowest(course)
        wish = course.steer(motion, driving=driving, speed=speed, slowest=slowest)
        top = task.terms.top_speed
        if top is not None and abs(wish.forward) > top:
            wish = replace(wish, forward=copysign(top, wish.forward))
        velocity = self._within_fence(course, wish, motion, seen, now=now)
        if velocity is None:
            self._change(S.HELD, R.FENCE, actor=SERVER, now=now)
            return view.HOLD
        return Demand(DemandKind.DRIVE, velocity)

    def _driving_of(self, task: Task) -> Driving:
        """Return the settings for a task: of a stock client's the speed is the vehicle's own."""
        driving = self._settings.driving
        if self.cruise is None or not task.terms.is_cruising:
            return driving
        return replace(driving, speed=min(self.cruise, driving.max_speed))

    def _begin_leg(self, *, now: float) -> None:
        self._stuck.begin(now=now)
        self._astray.begin_leg()
        self._follows.begin()
        self._arrival.begin_leg()

    def _set_aside_as_astray(self, task: Task, *, now: float) -> None:
        words = "does not go where it is told to: is its heading right?"
        self._book.record(VehicleNoted(task.vehicle, words, now))
        self._change(S.HELD, R.OFF_LINE, actor=SERVER, now=now)

    def _within_fence(
        self, course: Course, wish: Velocity, motion: Motion, seen: VehicleView, *, now: float
    ) -> Velocity | None:
        """Slow down before the fence; None: stop. A vehicle that began outside may come back in."""
        if self._is_coming_back and isinstance(course.leg, Move | Rotate | Follow):
            self._is_coming_back = not self._bounds.allows(motion.pose, seen.origin)
            if self._is_coming_back:
                return wish
        fence = self._bounds.local(seen.origin)
        return within_fence(wish, motion, fence, driving=self._settings.driving, now=now)

    def _arrive(
        self, task: Task, course: Course, seen: VehicleView, motion: Motion, now: float
    ) -> None:
        """The end of a leg: the next one, the next step, back to the task itself, or all done."""
        self._begin_leg(now=now)
        if course.advance(motion):
            if (course.by_course or course.steering) and course.misses > MISSES:
                self._finish(S.FAILED, R.STUCK, actor=SERVER, now=now)
                return
            if course is self._course:
                self._book.advance(task.id, course.progress, now=now)
        elif course is self._way_back:
            self._way_back = None
        elif not isinstance(task.goal, Plan):
            self._finish(S.COMPLETED, R.NONE, actor=SERVER, now=now)
        elif not (is_over(task.goal, course.progress) and course.progress.pending):
            after = self._leave_step(task, task.goal, now=now)
            if after is not None:
                self._go_on(task, after, seen, motion, now=now)

    # plans

    def skip_to(self, step: int, *, now: float) -> None:
        """Go on with another step of the begun plan; at once, if it is being driven."""
        task = self.task
        assert task is not None, "nothing has begun here"
        assert isinstance(task.goal, Plan), "only plans have steps"
        progress = skipped_to(task.goal, replace(task.progress, pending=()), step)
        self._course = self._way_back = None
        self._book.advance(task.id, progress, now=now)

    def _look_on_the_way(
        self,
        task: Task,
        plan: Plan,
        course: Course,
        motion: Motion,
        *,
        elapsed: float,
        now: float,
    ) -> None:
        if not course.progress.pending:
            return
        target = course.progress.target
        to_place = None if target is None else distance(motion.pose, target)
        looked = look_on_the_way(plan, course.progress, to_place=to_place, elapsed=elapsed)
        course.progress = looked.progress
        for step in looked.done:
            self._book.reached(task.id, step, performs=step in looked.performed, now=now)
        if looked.done:
            self._book.advance(task.id, course.progress, now=now)

    def _leave_step(self, task: Task, plan: Plan, *, now: float) -> Progress | None:
        """A step is done; gives the progress of the next one, None: the plan is over."""
        assert self._course is not None, "a step is driven on its course"
        progress = self._course.progress
        if not is_over(plan, progress):
            self._book.reached(task.id, progress.step, performs=False, now=now)
        left = tuple(n for n in progress.pending if not isinstance(plan.steps[n], Near))
        after = following(plan, replace(progress, pending=left))  # nearer than here it will not be
        if after is None:
            self._finish(S.COMPLETED, R.NONE, actor=SERVER, now=now)
        return after

    def _go_on(
        self, task: Task, progress: Progress, seen: VehicleView, motion: Motion, *, now: float
    ) -> bool:
        """Begin the next step where the vehicle is, moving or not."""
        self._book.note_progress(task.id, progress)  # whatever becomes of it: the last one is done
        here = self._set_out(task, progress, seen, motion, now=now)
        if here is None:
            return False
        self._book.advance(task.id, here, now=now)
        return True

    def _has_asked_to_stand(self, now: float) -> bool:
        """Whether zeros have been asked for long enough to call slowness a standstill."""
        return now - self._moved_at >= self._settings.watch.still_time

    def _pause_if_lost(self, seen: VehicleView, now: float) -> bool:
        """Interrupt when heartbeats or position are missing; whether it did."""
        lost = self._is_lost(seen, now)
        if lost:
            self.pause(lost, actor=SERVER, now=now)
        return bool(lost)

    def _is_lost(self, seen: VehicleView, now: float) -> TaskReason:
        """Return which of heartbeats and position is missing, or NONE."""
        if not seen.heard:
            return R.LINK_LOST
        if seen.motion is None or now - seen.motion.at > self._settings.watch.position_lost:
            return R.POSITION_LOST
        return R.NONE

    def _wait_for_return(self, seen: VehicleView, now: float) -> None:
        """A task PAUSED by a loss resumes by itself after a while of good data, or fails."""
        if not self._resumes_by_itself:
            return
        watch = self._settings.watch
        if now - self._since > watch.lost_timeout:
            self._finish(S.FAILED, R.LINK_TIMEOUT, actor=SERVER, now=now)
            return
        ours = seen.mode in (ModeKind.OURS, ModeKind.HOLD) and seen.armed
        task = self._begun(S.PAUSED)
        if not ours or start_blocker(seen, watch=watch, now=now, goal=goal_of(task)):
            self._lost_until = now
        elif now - self._lost_until >= watch.fresh_before_resume:
            self.resume(seen, actor=SERVER, now=now)

    def _note_progress(self, task: Task, now: float) -> None:
        assert self._course is not None
        executed = self._executed_before + now - self._since
        self._course.progress = replace(self._course.progress, execution_time=executed)
        self._book.note_progress(task.id, self._course.progress)
        is_written = self._book.durable >= self._kept_as  # a store that is away is not piled up on
        if now - self._kept_at >= KEEP_EACH and is_written:
            self._book.keep_progress(task.id, now=now)
            self._kept_at, self._kept_as = now, self._book.recorded

    def rest(self, motion: Motion, *, now: float) -> None:
        """Count what the vehicle has rolled since the task was paused: it stands here."""
        task, course = self.task, self._course
        if task is None or course is None or task.state is not S.PAUSED or self._way_back:
            return
        course.look(motion, elapsed=0.0)
        self._book.advance(task.id, course.progress, now=now)

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
        old, timing = self._book[self._task_id], None
        if old.state is S.EXECUTING:
            self._executed_before += now - self._since
            progress = replace(old.progress, execution_time=self._executed_before)
            timing, self._meter = self.timing, None
        self._since = self._taking_since = self._kept_at = now
        self._ask_again_at, self.waits_for = None, (R.NONE, "")
        self._book.change(
            self._task_id,
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
