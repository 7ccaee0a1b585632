"""Drives the active task of a vehicle while it is EXECUTING: path, arrival, fence, faults.

It never changes the task's state: it raises ``Becomes``, which the executor records.
"""

from dataclasses import replace
from math import copysign, inf, isnan
from typing import NamedTuple

from mav_tasks.config.settings import Driving, Settings
from mav_tasks.kinds import Act, GoTo
from mav_tasks.kinds.act import ACCEPTED, TOLD
from mav_tasks.kinds.base import Ability
from mav_tasks.kinds.guidance import ZERO, Motion
from mav_tasks.tasks import view
from mav_tasks.tasks.driving.arrival import Arrival
from mav_tasks.tasks.driving.bounds import Bounds, limited, within_fence
from mav_tasks.tasks.driving.estimate import Estimate, Known, time_left
from mav_tasks.tasks.driving.mission_sequencer import (
    begun,
    following,
    goal_of,
    is_over,
    look_on_the_way,
    present_goal,
)
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.stage import (
    lead_on,
    may_go_on_rolling,
    recovery_path,
    set_out,
)
from mav_tasks.tasks.driving.watches import AstrayWatch, Follows, StuckWatch
from mav_tasks.tasks.goal import Near, Plan
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Progress, Task
from mav_tasks.tasks.times import Times
from mav_tasks.tasks.view import Demand, DemandKind, VehicleView

S, R = TaskState, TaskReason

#: times that a vehicle may miss a place that its turning circle does not let it reach
MISSES = 3
#: how much farther than its way may be a task may drive to correct it: as a factor, and m
CORRECTIONS, SLACK = 1.05, 0.2
KEEP_EACH = 1.0  # s between two writes of a driven task's progress
SHARE_EACH = 0.5  # s between two estimates of how much of it is done; of a long plan they cost


class Becomes(Exception):
    """The driven task is over or interrupted: its next state, and why."""

    def __init__(self, state: TaskState, reason: TaskReason = R.NONE) -> None:
        super().__init__(state, reason)
        self.state, self.reason = state, reason


class Tick(NamedTuple):
    """The driven task and its vehicle, as they are now."""

    task: Task
    seen: VehicleView
    motion: Motion
    now: float


class Drive:
    """Driver of one vehicle's active task; ``begin`` precedes each EXECUTING."""

    def __init__(
        self, registry: TaskRegistry, settings: Settings, bounds: Bounds, times: Times
    ) -> None:
        self._registry = registry
        self._times = times
        self._bounds = bounds
        self.settings = settings
        #: m/s, speed of tasks that are ``is_cruising``; None: the settings' speed
        self.cruise: float | None = None
        self._course: PathFollower | None = None
        self._way_back: PathFollower | None = None  # recovery path, driven before the course
        self._last_velocity = ZERO
        self._moved_at = 0.0  # when a non-zero velocity was last commanded
        self._stuck = StuckWatch()
        self._follows = Follows()
        self._astray = AstrayWatch()
        self._arrival = Arrival()
        self._is_coming_back = False  # from outside into the fence
        self._shared_at = 0.0  # when the share that is done was last computed
        self._kept_at = 0.0  # when progress was last recorded for the store
        self._kept_as = 0  # the number of that event
        self._driven = 0.0  # m commanded so far for the active task
        self._told_act = False  # the present act, in this run and by this driver
        self._act_failed = R.NONE

    def __repr__(self) -> str:
        return f"Drive({self._course!r}, {self._last_velocity})"

    def forget(self) -> None:
        """Drop the path of the active task: another task, or step, takes its place."""
        self._course = self._way_back = None

    def entered(self, *, now: float) -> None:
        """Note a change of state, whose event stores the progress, too."""
        self._kept_at = now

    def set_speed(self, speed: float | None) -> None:
        """Set the speed from now on, m/s; None: the task's own."""
        if self._course is not None:
            self._course.progress = replace(self._course.progress, speed=speed)

    def act_answered(
        self,
        task: Task,
        step: int,
        accepted: bool | None,
        *,
        was_sent: bool,
        is_active: bool,
        now: float,
    ) -> bool:
        """Note the answer to an act, None: there was none. Return whether it was awaited."""
        progress, is_driven = task.progress, is_active and task.state is S.EXECUTING
        is_awaited = isinstance(goal_of(task), Act) and (progress.step, progress.done) == (
            step,
            TOLD,
        )
        if not is_awaited or (is_driven and not self._told_act):
            return False
        if accepted:
            done = ACCEPTED
        elif not was_sent or (accepted is not None and not is_driven):
            done = 0.0  # it is not done, and is told again when it is its turn
        else:
            if is_driven:
                self._act_failed = R.NO_ANSWER if accepted is None else R.REFUSED
            return True
        if is_active:
            self._told_act = False
            if self._course is not None:
                self._course.progress = replace(self._course.progress, done=done)
        self._registry.note_progress(task.id, replace(progress, done=done))
        self._registry.keep_progress(task.id, now=now)
        return True

    def limit(self, demand: Demand, *, elapsed: float, now: float) -> Demand:
        """Return a demand with its velocity limited and ramped from the last one."""
        if demand.kind is not DemandKind.DRIVE:
            self._last_velocity = ZERO
            return demand
        self._last_velocity = limited(
            demand.velocity, self._last_velocity, driving=self.settings.driving, elapsed=elapsed
        )
        if not self._last_velocity.is_zero:
            self._moved_at = now
        self._astray.commanded(self._last_velocity)
        self._stuck.commanded(self._last_velocity, seconds=self.settings.watch.setpoint_period)
        return Demand(DemandKind.DRIVE, self._last_velocity)

    def begin(self, task: Task, seen: VehicleView, motion: Motion, *, now: float) -> Progress:
        """Plan the path of a task that starts or resumes where the vehicle stands."""
        self._driven = task.progress.driven
        self._way_back = None
        if isinstance(goal_of(task), Act) and task.progress.done == TOLD:
            raise Becomes(S.HELD, R.OUTCOME_UNKNOWN)
        here = self._set_out(Tick(task, seen, motion, now), task.progress)
        course = self._course
        if course is None:
            return here
        self._astray = AstrayWatch()
        if task.progress.anchor is not None:
            self._way_back = recovery_path(
                course.goal,
                here,
                motion,
                honours_yaw_rate=seen.honours_yaw_rate,
                steering=course.steering,
            )
        return here

    def _set_out(self, tick: Tick, progress: Progress) -> Progress:
        """Plan the path of a stage that begins here, if it can begin; without one, it waits."""
        task, seen, motion, now = tick
        plan, driving = task.goal, self.settings.driving
        goal = present_goal(plan, progress)
        if isinstance(goal, GoTo) and goal.place is None:
            progress, waits = self._before_return(tick, progress)
            if waits:
                self._course = None
                return progress
        ability = Ability(seen.honours_yaw_rate, seen.turning, turns_by_course=seen.turns_by_course)
        if ability.is_steered and goal.why_not(ability):
            raise Becomes(S.FAILED, R.NOT_SUPPORTED_BY_VEHICLE)
        course = set_out(goal, begun(plan, progress), seen, motion, self._bounds)
        if course is None:
            raise Becomes(S.PAUSED, R.POSITION_LOST)
        here = course.progress
        done = goal.done_at(here.done, utc=now + self._times.wall_offset)
        if done != here.done:
            course.progress = here = replace(here, done=done)
        if (course.metres_to_place(motion) or 0.0) > driving.max_distance:
            raise Becomes(S.FAILED, R.BAD_PARAMETER)
        if task.terms.max_distance is not None:
            self._check_way(tick, self._left(tick, here).metres)
        metres = self._bounds.metres_to_leave(goal, here, motion.pose, seen.origin)
        if metres is not None:
            self._note(tick, f"would leave the fence in task {task.id} after {metres:.1f} m")
            is_new = task.progress.anchor is None and task.progress.step < 0
            raise Becomes(S.FAILED, R.OUTSIDE_FENCE) if is_new else Becomes(S.HELD, R.FENCE)
        self._is_coming_back = not self._bounds.allows(motion.pose, seen.origin)
        if isinstance(plan, Plan):
            lead_on(course, plan, seen, driving=driving)
        self._course = course
        self._begin_leg(now=now)
        return here

    def _before_return(self, tick: Tick, progress: Progress) -> tuple[Progress, bool]:
        """Do the steps before a return, one of which may set home; return whether it waits."""
        task = tick.task
        if not self._registry.is_durable(task.id):
            return progress, True
        if not isinstance(task.goal, Plan):
            return progress, tick.seen.is_home_old
        progress = begun(task.goal, progress)
        progress, waits = self._look_on_the_way(tick, progress, to_place=inf, elapsed=0.0)
        return progress, waits or tick.seen.is_home_old

    def _check_way(self, tick: Tick, left: float) -> None:
        """End a task that drives farther than its submitter may, and say so."""
        task = tick.task
        most, way = task.terms.max_distance, self._driven + left
        if most is None or way <= most * CORRECTIONS + SLACK:
            return
        long = "unknown" if isnan(way) else f"{way:.1f} m"
        self._note(tick, f"task {task.id} may drive {most:g} m: its way is {long}")
        raise Becomes(S.FAILED, R.NOT_ALLOWED)

    def go_on(
        self,
        task: Task,
        seen: VehicleView,
        motion: Motion,
        *,
        executed: float,
        elapsed: float,
        now: float,
    ) -> Demand:
        """Return this tick's demand; ``executed`` is the s of EXECUTING so far."""
        tick, watch = Tick(task, seen, motion, now), self.settings.watch
        self._driven += abs(self._last_velocity.forward) * elapsed
        self._check_way(tick, 0.0)
        if self._course is None:  # another step of a plan begins
            goal = goal_of(task)
            if not seen.still and not may_go_on_rolling(
                goal, task.progress, seen, motion, self._bounds
            ):
                return view.STAND
            if waits := self._go_on(tick, task.progress):
                return waits
        course = self._way_back or self._course
        assert course is not None, "EXECUTING begins by setting the course"
        is_held_back = not self._registry.is_durable(task.id)
        elapsed = 0.0 if is_held_back else elapsed
        course.look(motion, elapsed=elapsed)
        if isinstance(task.goal, Plan) and course is self._course and not is_held_back:
            if course.progress.pending:
                course.progress, _ = self._look_on_the_way(
                    tick, course.progress, to_place=course.metres_to_place(motion), elapsed=elapsed
                )
            if course.has_passed(motion):
                self._registry.note_progress(task.id, self._leave_step(task, task.goal, now=now))
                self._course = None
                return Demand(DemandKind.DRIVE, self._last_velocity)
        self._note_progress(tick, executed=executed)
        # zeros were commanded for long enough to call slowness a standstill
        stands = seen.still and now - self._moved_at >= watch.still_time
        if self._arrival.stands_here(
            course,
            motion,
            self._last_velocity,
            stands=stands,
            driving=self.settings.driving,
            now=now,
        ):
            if not stands and not course.leg.is_standing:
                return view.STAND
            return self._arrive(tick, course) or view.STAND
        if is_held_back:
            self._stuck.begin(now=now)
            return view.STAND
        if isinstance(course.leg, Act):
            if not course.progress.pending:  # what comes before it in the plan is done before it
                self._act(task, course, now=now)
            return view.STAND
        if self._stuck.is_stuck(course, seen, limit=watch.stuck, now=now):
            raise Becomes(S.FAILED, R.STUCK)
        news = self._follows.look(
            self._last_velocity, motion, seconds=watch.setpoint_period, now=now
        )
        if news:
            self._note(tick, news)
        if self._astray.is_astray(course, motion):
            self._note(tick, "does not follow its setpoints: check its heading")
            raise Becomes(S.HELD, R.OFF_TRACK)
        wish = course.steer(
            motion,
            driving=self._driving_of(task),
            speed=None if course is self._way_back else course.progress.speed,
            slowest=self._arrival.slowest(course),
        )
        top = task.terms.top_speed
        if top is not None and abs(wish.forward) > top:
            wish = replace(wish, forward=copysign(top, wish.forward))
        if self._is_coming_back and course.leg.has_end:
            self._is_coming_back = not self._bounds.allows(motion.pose, seen.origin)
            if self._is_coming_back:  # from outside the fence it may drive in
                return Demand(DemandKind.DRIVE, wish)
        fence = self._bounds.local(seen.origin)
        velocity = within_fence(wish, motion, fence, driving=self.settings.driving, now=now)
        if velocity is None:
            raise Becomes(S.HELD, R.FENCE)
        return Demand(DemandKind.DRIVE, velocity)

    def rest(self, task: Task, motion: Motion, *, now: float) -> None:
        """Record how far the vehicle rolled since the task was paused; it stands now."""
        course = self._course
        if course is not None and self._way_back is None:
            course.look(motion, elapsed=0.0)
            self._registry.advance(task.id, course.progress, now=now)

    def _note(self, tick: Tick, words: str) -> None:
        """Report a text about the vehicle of a task."""
        self._registry.note(tick.task.vehicle, words, now=tick.now)

    def _driving_of(self, task: Task) -> Driving:
        """Return the settings for a task; a task that is cruising has the vehicle's own speed."""
        driving = self.settings.driving
        if self.cruise is None or not task.terms.is_cruising:
            return driving
        return replace(driving, speed=min(self.cruise, driving.max_speed))

    def _act(self, task: Task, course: PathFollower, *, now: float) -> None:
        """Tell the vehicle once, when it is durable that it will be told; fail if that failed."""
        if self._act_failed:
            raise Becomes(S.FAILED, self._act_failed)
        if course.progress.done == 0.0:
            course.progress = replace(course.progress, done=TOLD)
            self._registry.will_act(task.id, course.progress, now=now)
        elif not self._told_act:
            self._told_act = True
            self._registry.acts(task.id, course.progress.step, now=now)

    def _begin_leg(self, *, now: float) -> None:
        self._told_act, self._act_failed = False, R.NONE
        self._stuck.begin(now=now)
        self._astray.begin_leg()
        self._follows.begin()
        self._arrival.begin_leg()

    def _arrive(self, tick: Tick, course: PathFollower) -> Demand | None:
        """End a leg: begin the next leg or step, leave the recovery path, or complete the task."""
        task, _, motion, now = tick
        self._begin_leg(now=now)
        if course.advance(motion):
            if (course.by_course or course.steering) and course.misses > MISSES:
                raise Becomes(S.FAILED, R.STUCK)
            if course is self._course:
                self._registry.advance(task.id, course.progress, now=now)
        elif course is self._way_back:
            self._way_back = None
        elif not isinstance(task.goal, Plan):
            raise Becomes(S.COMPLETED)
        elif not (is_over(task.goal, course.progress) and course.progress.pending):
            return self._go_on(tick, self._leave_step(task, task.goal, now=now))
        return None

    def _look_on_the_way(
        self, tick: Tick, progress: Progress, *, to_place: float | None, elapsed: float
    ) -> tuple[Progress, bool]:
        """Do the steps on the way that are due; return whether one is a command to the vehicle."""
        task, now = tick.task, tick.now
        assert isinstance(task.goal, Plan), "only a plan has steps"
        looked = look_on_the_way(task.goal, progress, to_place=to_place, elapsed=elapsed)
        for step in looked.done:
            performs = looked.performs and step == looked.done[-1]
            self._registry.reached(task.id, step, performs=performs, now=now)
        if looked.done:
            self._registry.advance(task.id, looked.progress, now=now)
        return looked.progress, looked.performs

    def _leave_step(self, task: Task, plan: Plan, *, now: float) -> Progress:
        """End the current step. Return the progress of the next one, if there is one."""
        assert self._course is not None, "a step is driven on its course"
        progress = self._course.progress
        if not is_over(plan, progress):
            self._registry.reached(task.id, progress.step, performs=False, now=now)
        left = tuple(n for n in progress.pending if not isinstance(plan.steps[n], Near))
        after = following(plan, replace(progress, pending=left))  # unmet Near conditions lapse
        if after is None:
            raise Becomes(S.COMPLETED)
        return after

    def _go_on(self, tick: Tick, progress: Progress) -> Demand | None:
        """Begin the next step where the vehicle is, moving or not. Return why not, or None."""
        task_id = tick.task.id
        self._registry.note_progress(task_id, progress)  # in any case the last step is done
        here = self._set_out(tick, progress)
        if self._course is None:
            self._registry.note_progress(task_id, here)
            return view.STAND
        self._registry.advance(task_id, here, now=tick.now)
        return None

    def _left(self, tick: Tick, progress: Progress) -> Estimate:
        task, seen, motion, _ = tick
        known = Known(self._driving_of(task), motion.pose, seen.home, seen.origin)
        return time_left(task.goal, progress, known)

    def _note_progress(self, tick: Tick, *, executed: float) -> None:
        assert self._course is not None
        progress, registry, now = self._course.progress, self._registry, tick.now
        share = progress.share
        if now - self._shared_at >= SHARE_EACH:
            self._shared_at = now
            left = self._left(tick, progress).seconds
            if not isnan(left):
                share = max(share, executed / max(executed + left, SHARE_EACH))
        progress = replace(progress, share=share, execution_time=executed, driven=self._driven)
        self._course.progress = progress
        registry.note_progress(tick.task.id, progress)
        is_written = registry.durable >= self._kept_as  # no backlog for a store that is away
        if now - self._kept_at >= KEEP_EACH and is_written:
            registry.keep_progress(tick.task.id, now=now)
            self._kept_at, self._kept_as = now, registry.recorded
