"""The tasks of one vehicle: its queue, those begun, and what makes the queue stand.

The STOP latch is the queue's pause reason STOPPED: there is no second flag. Nothing here knows how
a vehicle is spoken to; ``step`` says what it must be made to do.

One task at a time has the vehicle. Others may have begun and be set aside: pre-empted, or held.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from mav_tasks.errors import Rejection
from mav_tasks.settings import SET_FAILSAFE, Driving, Settings
from mav_tasks.tasks import view
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.itinerary import goal_of, has_local_place, present_goal, skipped_to
from mav_tasks.tasks.driving.jump import JumpWatch
from mav_tasks.tasks.driving.led_away import LedAway
from mav_tasks.tasks.driving.legs import leg_of
from mav_tasks.tasks.driving.limits import safe_braking
from mav_tasks.tasks.driving.way_back import is_off_line
from mav_tasks.tasks.events import (
    SERVER,
    QueueContinued,
    QueuePaused,
    TaskWaits,
    VehicleArmingSet,
    VehicleHalted,
    VehicleHomeSet,
    VehicleIdentified,
    VehicleNoted,
    VehicleSpeedSet,
)
from mav_tasks.tasks.executor import Executor, has_moved
from mav_tasks.tasks.goal import GlobalPlace, MoveTurned, Plan, Rotate, SingleGoal
from mav_tasks.tasks.halts import Halts
from mav_tasks.tasks.lifecycle import TAKEN, WAITING, TaskReason, TaskState, words_of
from mav_tasks.tasks.queue import Rank, TaskQueue
from mav_tasks.tasks.scheduler import outranks, start_blocker
from mav_tasks.tasks.task import Draft, Frame, Progress, Submitter, Task, TaskId, Terms, same_frame
from mav_tasks.tasks.timing import Timing
from mav_tasks.tasks.view import Demand, VehicleView
from mav_tasks.tasks.waiting_room import WaitingRoom

R, S = TaskReason, TaskState

#: of a vehicle that restarts: what a release waits for
OF_RESTART = frozenset({R.VEHICLE_SILENT, R.NO_POSITION})


@dataclass(frozen=True, slots=True)
class _Release:
    """A held task that a person has released, and that goes on when the vehicle is up."""

    task_id: TaskId
    again: bool
    may_continue: bool  # who has released it might also let the queue go on
    actor: str
    until: float
    waits_for: TaskReason


#: what the person who reads a refusal may do about it
WAYS_OUT = {
    R.WRONG_MODE: "wrong mode, set HOLD first",
    R.DISARMED: "disarmed; continue, or arm it",
    R.LOSS_FAILSAFE: f"it would not stand without us, {SET_FAILSAFE}",
}


class VehicleTasks:
    """All tasks of the vehicle with this system id."""

    def __init__(self, vehicle: int, book: TaskBook, room: WaitingRoom, settings: Settings) -> None:
        self.vehicle = vehicle
        self._book = book
        self._room = room
        self._queue = room.queue(vehicle)
        self._settings = settings
        #: where it may drive, and where it returns to
        self.bounds = Bounds()
        self._executor = Executor(book, settings, self.bounds)
        self._jumps = JumpWatch()
        self._aside: dict[TaskId, None] = {}
        self._of_earlier_run: set[TaskId] = set()
        self._led_away = LedAway()
        self._uid = ""  # of the vehicle, as far as it was heard
        self._speed: float | None = None  # of what names none; None: the settings' one
        self._cruise: float | None = None  # m/s, at which the vehicle itself would drive
        self._stop: tuple[float, float] | None = None  # m/s and m of one that was measured
        self._paused = R.NONE
        self._may_be_armed = True  # nobody has disarmed it, or somebody has let go since
        #: what made the vehicle stand, and when
        self.halts = Halts()
        self._urgent: TaskId | None = None  # runs although the queue is paused
        self._is_halting = False  # killed: nothing begins before the vehicle stands
        self._begun_at = 0.0
        self._blocker = R.NONE  # why the next task does not begin
        self._blocked: TaskId | None = None  # which task that was
        self._release: _Release | None = None  # waits until the vehicle has restarted

    def __repr__(self) -> str:
        return f"VehicleTasks({self.vehicle}, {self._queue!r}, {self._paused.name}, {self.begun!r})"

    # what can be seen

    @property
    def begun(self) -> Task | None:
        """The task that has the vehicle: begun, not over and not set aside."""
        return self._executor.task

    @property
    def aside(self) -> list[Task]:
        """The tasks that have begun and were set aside."""
        return [self._book[task_id] for task_id in self._aside]

    @property
    def is_driving(self) -> bool:
        """Whether any task has begun and is not over."""
        return self.begun is not None or bool(self._aside)

    @property
    def paused(self) -> TaskReason:
        """Why the queue stands, or NONE."""
        return self._paused

    @property
    def is_stopped(self) -> bool:
        """Whether STOP is latched."""
        return self._paused is R.STOPPED

    @property
    def waiting(self) -> list[TaskId]:
        """Waiting tasks, next one first."""
        return self._room.of(self.vehicle)

    @property
    def urgent(self) -> TaskId | None:
        """The task that runs although the queue is paused."""
        return self._urgent

    @property
    def queue(self) -> TaskQueue:
        """The tasks that are ready, to be looked at only."""
        return self._queue

    @property
    def is_halting(self) -> bool:
        """Whether nothing begins before the vehicle stands, because a task was killed."""
        return self._is_halting

    @property
    def next_waiting(self) -> TaskId | None:
        """The task that is next in the queue."""
        return self._queue.first()

    @property
    def capacity(self) -> int:
        """How many tasks may wait."""
        return self._settings.queueing.capacity

    @property
    def is_idle(self) -> bool:
        """Whether there is neither a begun task nor one that could begin now."""
        return not self.is_driving and len(self._queue) == 0

    @property
    def is_empty(self) -> bool:
        """Whether there is no task at all that is not over."""
        return not self.is_driving and self._room.count(self.vehicle) == 0

    @property
    def awaits_commit(self) -> bool:
        """Whether the next task waits for nothing but its submission being durable."""
        first = None if self.begun is not None else self._next()
        return first is not None and not self._book.is_durable(first)

    @property
    def unfinished(self) -> list[Task]:
        """All tasks that are not over, in the order of their ids."""
        begun = [] if self.begun is None else [self.begun.id]
        return [self._book[task_id] for task_id in sorted([*begun, *self._aside, *self.waiting])]

    def page(self, first: int, count: int) -> list[TaskId]:
        """Give up to ``count`` waiting tasks from a position on."""
        if first + count <= len(self._queue):
            return self._queue.page(first, count)
        if first >= self._room.count(self.vehicle):
            return []  # without putting all that wait in order
        return self.waiting[first : first + count]

    def start_time(self, task: Task) -> float:
        """Give the monotonic time before which a task does not begin; -inf without one."""
        return self._room.due_at(task)

    def blocker_of(self, task_id: TaskId) -> TaskReason:
        """Give what keeps the next task, or a begun one, from being driven; NONE for others."""
        if self._release is not None and self._release.task_id == task_id:
            return self._release.waits_for
        begun = self.begun
        if begun is not None and begun.id == task_id:
            return self._executor.waits_for[0]
        return self._blocker if self._blocked == task_id else R.NONE

    def words_of_blocker(self, task_id: TaskId) -> str:
        """Return what the vehicle itself says of what keeps a task from beginning, or ""."""
        begun = self.begun
        return self._executor.waits_for[1] if begun is not None and begun.id == task_id else ""

    def timing_of(self, task: Task) -> Timing | None:
        """Give how evenly a task's setpoints have left, None if it was not driven."""
        begun = self.begun
        return self._executor.timing if begun is not None and begun.id == task.id else task.timing

    @property
    def held(self) -> Task | None:
        """The task that somebody must decide about; None: there is none, or it is decided."""
        begun = self.begun
        if begun is not None and begun.state is S.HELD:
            return begun if self._release is None else None
        return next((task for task in self.aside if task.state is S.HELD), None)

    @property
    def is_held_ahead(self) -> bool:
        """Whether a held task keeps all others from beginning."""
        begun = self.begun
        if begun is not None and begun.state is S.HELD:
            return True
        return bool(self._aside) and any(task.state is S.HELD for task in self.aside)

    # coming, changing, going

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        self._apply_driving()

    def _apply_driving(self) -> None:
        self._executor.apply(replace(self._settings, driving=self.driving))
        self._executor.cruise = self._cruise if self._speed is None else None

    @property
    def driving(self) -> Driving:
        """The settings for driving, with the speed that a client has set, and known brakes."""
        driving = self._settings.driving
        if self._stop is not None:
            driving = replace(driving, acceleration=safe_braking(driving, *self._stop))
        return driving if self._speed is None else replace(driving, speed=self._speed)

    def cruises(self, speed: float | None) -> None:
        """Note at what speed the vehicle itself drives, m/s, where none is named; None: unknown."""
        if speed != self._cruise:
            self._cruise = speed
            self._apply_driving()

    def brakes(self, stop: tuple[float, float] | None) -> None:
        """Note how it was seen to stop, m/s and the metres that it took; None: that is unknown."""
        if stop != self._stop:
            self._stop = stop
            self._apply_driving()

    def restore(
        self,
        tasks: Iterable[Task],
        *,
        paused: TaskReason,
        speed: float | None,
        uid: str,
        halt_epoch: int = 1,
        may_be_armed: bool = True,
        now: float,
    ) -> None:
        """Take on what had begun in an earlier run, as it was left."""
        self._may_be_armed = may_be_armed
        self.halts = Halts(epoch=halt_epoch)
        self.halt(R.RESTARTED, actor=SERVER, now=now)
        self._paused = paused
        self._uid = uid
        self._speed = speed
        self._apply_driving()
        for task in tasks:
            self._of_earlier_run.add(task.id)
            if self.begun is None and task.reason is not R.PREEMPTED:
                self._executor.adopt(task)
            else:
                self._aside[task.id] = None

    def halt(self, reason: TaskReason, *, actor: str, now: float) -> None:
        """Note that the vehicle is to stand: what lets it go on has to be newer than this.

        What was to run at once and has not begun waits as any other; what was released and has not
        begun is held as before.
        """
        self._release = None
        if self._urgent is not None and (self.begun is None or self.begun.id != self._urgent):
            self._urgent = None
        if self.halts.raise_epoch(reason, actor=actor, now=now):
            epoch = self.halts.epoch
            self._book.record(VehicleHalted(self.vehicle, epoch, reason, actor, now))

    @property
    def may_be_armed(self) -> bool:
        """Whether the vehicle may be armed, as far as that is a person's word."""
        return self._may_be_armed

    def let_arm(self, *, may_be_armed: bool, now: float) -> None:
        """Keep, over a restart too, whether somebody has disarmed it."""
        if may_be_armed != self._may_be_armed:
            self._may_be_armed = may_be_armed
            self._book.record(VehicleArmingSet(self.vehicle, may_be_armed, now))

    def identified(self, uid: str, *, now: float) -> None:
        """The vehicle has said which one it is; another one does not run this one's tasks unasked.

        "" is what a vehicle says that does not know.
        """
        if not uid or uid == self._uid:
            return
        before, self._uid = self._uid, uid
        self._book.record(VehicleIdentified(self.vehicle, uid, now))
        if before:
            self._may_be_another(now=now)

    def set_home(self, place: GlobalPlace, frame: Frame, *, actor: str, now: float) -> None:
        """Keep where the vehicle returns to, as long as it does not boot again."""
        latitude, longitude = place.latitude_degE7, place.longitude_degE7
        home = VehicleHomeSet(self.vehicle, latitude, longitude, frame, actor, now)
        self.bounds.home = home
        self._book.record(home)

    @property
    def has_uid(self) -> bool:
        """Whether it is known by its unique id whose tasks these are."""
        return bool(self._uid)

    def unidentified(self, *, now: float) -> None:
        """The vehicle does not say which one it is, though the one of these tasks has."""
        self._uid = ""
        self._may_be_another(now=now)

    def _may_be_another(self, *, now: float) -> None:
        self._release = None
        if self.is_driving or self._room.count(self.vehicle):
            self.halt(R.RESTARTED, actor=SERVER, now=now)
            self._executor.pause(R.OPERATOR, actor=SERVER, now=now)
            self._pause_queue(R.RESTARTED, actor=SERVER, now=now)

    def count_of(self, submitter: Submitter) -> int:
        """Give how many tasks of a submitter wait, on any vehicle."""
        return self._room.count_of(submitter)

    def submit(self, draft: Draft, *, now: float) -> Task:
        """Take a task in; Rejection when too many wait."""
        return self._room.submit(draft, now=now)

    def waits(self, task: Task) -> bool:
        """Whether a task has not begun."""
        return task.state in WAITING

    def withdraw(self, task: Task, *, now: float) -> None:
        """Take back a submission that did not become durable; it cannot have begun."""
        self._room.withdraw(task, now=now)

    def run_now(self, draft: Draft, seen: VehicleView, *, actor: str, now: float) -> Task:
        """Take a task in that runs at once; what runs and what waits goes on when continued.

        Rejection when it could not: nobody expects it to begin when somebody parks the vehicle.
        """
        if self.is_stopped:
            raise Rejection(R.STOPPED, "STOP is latched: continue first")
        if self.is_held_ahead:
            raise Rejection(R.HELD_AHEAD, "a held task must be released first")
        self._check_start(seen, present_goal(draft.goal, Progress()), now=now)
        task = self._room.submit(draft, now=now)
        self.give_way_to(task, actor=actor, now=now)
        return task

    def give_way_to(self, task: Task, *, actor: str, now: float) -> None:
        """Let a waiting task run at once; what runs and what waits goes on when continued."""
        begun = self.begun
        if begun is not None and begun.id == self._urgent:
            self._executor.cancel(R.REPLACED, actor=actor, now=now)
        elif begun is not None and begun.state in (S.STARTING, S.EXECUTING, S.PAUSED):
            self._executor.pause(R.OPERATOR, actor=actor, now=now)
            self._set_aside(begun.id)
        if self._urgent is not None:
            self._replace_urgent(actor=actor, now=now)
        self._urgent = task.id
        self._pause_queue(R.OPERATOR, actor=actor, now=now)

    def _replace_urgent(self, *, actor: str, now: float) -> None:
        assert self._urgent is not None
        before = self._book.get(self._urgent)
        if before is not None and before.state in WAITING:
            self._room.end(before, S.CANCELLED, R.REPLACED, actor=actor, now=now)

    def cancel(self, task: Task, *, kill: bool, reason: TaskReason, actor: str, now: float) -> None:
        """Call a task off, or (kill) end it at once; the vehicle stands before anything begins.

        One that somebody else has is not made to stand: that is what STOP is for.
        """
        state = S.KILLED if kill else S.CANCELLED
        if task.state in WAITING:
            self._room.end(task, state, reason, actor=actor, now=now)
        elif task.id in self._aside:
            del self._aside[task.id]
            if task.state is S.PAUSED and not kill:
                self._book.change(task.id, S.CANCELLING, reason=reason, actor=actor, now=now)
            self._book.change(task.id, state, reason=reason, actor=actor, now=now)
            self._room.ended(task.id, now=now)
        elif kill:
            self.halt(reason, actor=actor, now=now)
            self._is_halting |= not self._is_of_another_driver(task)
            self._executor.kill(reason, actor=actor, now=now)
            self._ended(task.id, now=now)
        else:
            self.halt(reason, actor=actor, now=now)
            self._executor.cancel(reason, actor=actor, now=now)
            if self.begun is None:
                self._ended(task.id, now=now)

    def _is_of_another_driver(self, task: Task) -> bool:
        """Whether a begun task stands because somebody else has the vehicle, who keeps it."""
        was_taken = self._paused in TAKEN and task.reason is R.FRAME_RESET
        return task.reason in TAKEN or was_taken

    def modify(self, task: Task, terms: Terms, *, actor: str, now: float) -> None:
        """Change a task's terms; Rejection when it would wait for itself, or for nothing."""
        if task.state in WAITING:
            self._room.modify(task, terms, actor=actor, now=now)
        else:
            self._book.modify(task.id, terms, actor=actor, now=now)

    def clear(self, *, begun_too: bool, actor: str, now: float) -> None:
        """Cancel what waits; with ``begun_too`` also what has begun."""
        self._room.clear(self.vehicle, R.CLEARED, actor=actor, now=now)
        if not begun_too:
            return
        for task in [*self.aside, *([] if self.begun is None else [self.begun])]:
            self.cancel(task, kill=False, reason=R.CLEARED, actor=actor, now=now)

    def release(
        self,
        task: Task,
        *,
        again: bool,
        may_continue: bool,
        seen: VehicleView,
        actor: str,
        now: float,
    ) -> None:
        """Let a held task go on from here: all of it again, or its remainder.

        Raise Rejection, and change nothing, while it could not take the vehicle. While the queue is
        paused, or a vehicle that has restarted is not up yet, the task waits for that, until
        something halts it. A pause for a restart is over for it if who releases it
        ``may_continue``.
        """
        if self.is_stopped:
            raise Rejection(R.STOPPED, "STOP is latched: continue first")
        begun = self.begun
        if begun is not None and begun.id != task.id and begun.state not in (S.HELD, S.PAUSED):
            words = f"task {begun.id} is {begun.state.name.lower()}"
            raise Rejection(R.WRONG_STATE, words)
        waits_for = self._waits_for(task, seen, may_continue=may_continue, now=now)
        if not waits_for:
            self._check_start(seen, goal_of(task), now=now)
        if not again:
            self._check_remainder(task, seen)
        if begun is not None and begun.id != task.id:
            self._set_aside(begun.id)
        if self.begun is None:
            self._aside.pop(task.id, None)
            self._executor.adopt(task)
        self._of_earlier_run.discard(task.id)
        if waits_for:
            until = now + self._settings.watch.ready_timeout
            self._release = _Release(task.id, again, may_continue, actor, until, waits_for)
            self._book.record(TaskWaits(task.id, self.vehicle, waits_for, now))
            return
        self._begin_released(again=again, actor=actor, now=now)

    def _begin_released(self, *, again: bool, actor: str, now: float) -> None:
        self._release = None
        self._executor.release(again=again, actor=actor, now=now)
        self._begun_at = now

    def _waits_for(
        self, task: Task, seen: VehicleView, *, may_continue: bool, now: float
    ) -> TaskReason:
        """Return what a held task waits for that is released, NONE if it can go on."""
        if self._paused and not (self._paused is R.RESTARTED and may_continue):
            return R.QUEUE_PAUSED
        return self._waits_for_restart(task, seen, now=now)

    def _waits_for_restart(self, task: Task, seen: VehicleView, *, now: float) -> TaskReason:
        """Return what a held task waits for, NONE unless the vehicle restarts and is not up."""
        if task.reason is not R.FRAME_RESET:
            return R.NONE
        if seen.heard and seen.is_booting:  # and shows another mode for a moment
            return R.NO_POSITION
        goal = goal_of(task)
        blocker = start_blocker(seen, watch=self._settings.watch, now=now, goal=goal)
        return blocker if blocker in OF_RESTART else R.NONE

    @property
    def resumes_by_itself(self) -> bool:
        """Whether a task stands only as long as the vehicle, or its position, is not heard of."""
        return self._executor.resumes_by_itself

    @property
    def has_release(self) -> bool:
        """Whether a task was released that goes on as soon as it can."""
        return self._release is not None

    def forget_release(self) -> None:
        """A released task that has not begun is held as before: something has halted it."""
        self._release = None

    def _try_released(self, seen: VehicleView, *, now: float) -> None:
        """Let a released task begin when the vehicle is up, or hold it as before."""
        release, task = self._release, self.begun
        if release is None:
            return
        if task is None or task.id != release.task_id or task.state is not S.HELD:
            self._release = None
            return
        waits_for = self._waits_for(task, seen, may_continue=release.may_continue, now=now)
        if not waits_for:
            try:
                self._check_start(seen, goal_of(task), now=now)
            except Rejection as refusal:
                self._note_held(task, refusal.text, now=now)
            else:
                self._begin_released(again=release.again, actor=release.actor, now=now)
        elif now >= release.until and waits_for is not R.QUEUE_PAUSED:
            self._note_held(task, f"waited too long: {words_of(waits_for)}", now=now)
        elif waits_for is not release.waits_for:
            self._release = replace(release, waits_for=waits_for)
            self._book.record(TaskWaits(task.id, self.vehicle, waits_for, now))

    def _note_held(self, task: Task, why: str, *, now: float) -> None:
        self._release = None
        words = f"task {task.id} is on hold, release it again: {why}"
        self._book.record(VehicleNoted(self.vehicle, words, now))

    def _check_remainder(self, task: Task, seen: VehicleView) -> None:
        """What is left must be known: measured along its line, or counted until it was held."""
        progress = task.progress
        if task.reason is R.FRAME_RESET and has_local_place(task.goal):
            words = (
                f"places of task {task.id} were in a frame that is lost: run it again, or skip it"
            )
            raise Rejection(R.WRONG_STATE, words)
        counts_from_here = task.reason in (R.FRAME_RESET, R.OFF_LINE)
        if not counts_from_here and seen.motion and is_off_line(task, seen.motion.pose):
            words = f"off the line of task {task.id}: run it again from here, or skip it"
            raise Rejection(R.OFF_LINE, words)
        if task.reason is not R.OUTCOME_UNKNOWN or progress.anchor is None:
            return
        goal = goal_of(task)
        leg = leg_of(goal, progress) if isinstance(goal, Rotate | MoveTurned) else None
        turned = isinstance(leg, Rotate) and abs(leg.angle) > 3.0
        if turned or not same_frame(progress.frame, seen.frame):
            words = f"what task {task.id} had done is not known: run it again, or skip it"
            raise Rejection(R.WRONG_STATE, words)

    def skip_to(self, task: Task, step: int, *, now: float) -> None:
        """Let a plan that is not over go on, or begin, with another of its steps."""
        assert isinstance(task.goal, Plan), "only plans have steps"
        if self.begun is not None and self.begun.id == task.id:
            self._executor.skip_to(step, now=now)
        else:
            progress = skipped_to(task.goal, replace(task.progress, pending=()), step)
            self._book.advance(task.id, progress, now=now)

    def rest(self, seen: VehicleView, *, now: float) -> None:
        """The server ends, and the vehicle was stopped for it: what it has rolled counts."""
        if seen.motion is not None:
            self._executor.rest(seen.motion, now=now)

    def set_speed(self, speed: float | None, *, actor: str, now: float) -> TaskId | None:
        """Set the speed of the task that runs, and of those to come that name none."""
        self._speed = speed
        self._apply_driving()
        self._executor.set_speed(speed)
        self._book.record(VehicleSpeedSet(self.vehicle, speed, actor, now))
        return None if self.begun is None else self.begun.id

    def pause(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """Let the begun task and the queue stand; gives the task's id. Never undoes a STOP.

        Where somebody else has the vehicle, nobody waits for it to stand before a cancelled task is
        over.
        """
        self.halt(reason, actor=actor, now=now)
        self._release = None
        self._executor.pause(reason, actor=actor, now=now)
        self._pause_queue(reason, actor=actor, now=now)
        begun = self.begun
        if reason in TAKEN:
            last = self._jumps.last
            self._led_away.taken_over(None if last is None else last.pose)
            if begun is not None and begun.state is S.CANCELLING:
                self._executor.let_go(actor=actor, now=now)
                self._ended(begun.id, now=now)
                begun = None
        return None if begun is None else begun.id

    def proceed(
        self, seen: VehicleView, *, allows: bool = False, actor: str, now: float
    ) -> TaskId | None:
        """Release the STOP latch or any other pause; gives the task that goes on, if one does.

        A task that could not take the vehicle now is not resumed: Rejection says what is in its
        way, and everything stays as it is. A held task keeps the queue standing all the same; if
        that is all that makes it stand, and arming is not what is allowed again (``allows``),
        there is nothing to continue: Rejection.
        """
        begun = self.begun
        held = self.held
        resumes = begun is not None and begun.state is S.PAUSED and held is None
        if held is not None and not self._paused and not allows:
            words = (
                f"task {held.id} is held ({words_of(held.reason)}): release it first, again,"
                " remainder or skip"
            )
            raise Rejection(R.WRONG_STATE, words)
        if resumes:
            assert begun is not None
            self._check_start(seen, goal_of(begun), now=now)
        if self._paused:
            self._paused = R.NONE
            self.halts.lets_go()
            self._book.record(QueueContinued(self.vehicle, actor, now))
            self._led_away.given_back(seen, self._aside)
        if resumes:
            assert begun is not None
            self._resume(begun, seen, actor=actor, now=now)
        begun = self.begun
        return None if begun is None or held is not None else begun.id

    def _check_start(self, seen: VehicleView, goal: SingleGoal, *, now: float) -> None:
        blocker = start_blocker(seen, watch=self._settings.watch, now=now, goal=goal)
        if blocker:
            raise Rejection(blocker, f"cannot go on: {WAYS_OUT.get(blocker, words_of(blocker))}")

    def _resume(self, task: Task, seen: VehicleView, *, actor: str, now: float) -> None:
        if self._is_of_another_frame(task, seen):
            self._executor.hold(R.FRAME_RESET, now=now)
        else:
            self._executor.resume(seen, actor=actor, now=now)
            self._begun_at = now

    def _is_of_another_frame(self, task: Task, seen: VehicleView) -> bool:
        """Whether what is left of an earlier run was in coordinates that mean nothing any more."""
        return (
            task.id in self._of_earlier_run
            and task.progress.anchor is not None
            and not same_frame(task.progress.frame, seen.frame)
        )

    def hold(self, reason: TaskReason, *, now: float) -> None:
        """Set the begun task aside until somebody decides what becomes of it.

        With its frame every other line is lost, too.
        """
        if self.is_driving:
            self.halt(reason, actor=SERVER, now=now)
        self._executor.hold(reason, now=now)
        if reason is R.FRAME_RESET:
            for task in self.aside:
                if task.state is S.PAUSED and task.progress.anchor is not None:
                    self._book.change(task.id, S.HELD, reason=reason, actor=SERVER, now=now)

    def restarted(self, *, was_paused: TaskReason, now: float) -> bool:
        """The vehicle has restarted: hold what has begun, and let the queue stand until continued.

        Return whether the begun task, of which nothing was driven, begins again by itself instead.
        ``was_paused`` is why the queue stood before the vehicle was seen disarmed: that was the
        restart, and no takeover.
        """
        self._release = None
        begun = self.begun
        if begun is not None and begun.state is S.CANCELLING:
            self._executor.let_go(actor=SERVER, now=now)
            self._ended(begun.id, now=now)
        if not self._aside and self._executor.begins_again(now=now):
            return True
        self.hold(R.FRAME_RESET, now=now)
        if self.is_driving and not was_paused:
            self._pause_queue(R.RESTARTED, actor=SERVER, now=now)
        return False

    def stop(self, *, clear: bool, actor: str, now: float) -> TaskId | None:
        """Kill the begun task and latch; with ``clear`` all others are cancelled too."""
        self.halt(R.STOPPED, actor=actor, now=now)
        killed = self._executor.kill(R.STOP, actor=actor, now=now)
        self._urgent = None
        self._pause_queue(R.STOPPED, actor=actor, now=now)
        if clear:
            self.clear(begun_too=True, actor=actor, now=now)
        if killed is not None:
            self._room.ended(killed, now=now)
        return killed

    # time

    def setpoint_left(self, *, now: float) -> None:
        """A setpoint leaves for the vehicle now."""
        self._executor.setpoint_left(now=now)

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Begin what can begin, and give what the vehicle must be made to do now."""
        has_jumped = self._jumps.has_jumped(seen.motion, driving=self._settings.driving)
        if has_jumped and self.is_driving:
            self.hold(R.FRAME_RESET, now=now)
        if self.is_stopped:
            return view.STOP
        if self._is_halting:
            if not seen.still:
                return view.HALT
            self._is_halting = False
        self._try_released(seen, now=now)
        before = self.begun
        demand = self._executor.step(seen, now=now)
        if before is not None:
            self._note_step(before, now=now)
        if self.begun is not None and not self._is_interrupted(seen, now=now):
            return demand
        self._begin_next(seen, now=now)
        if self.begun is not None:  # what was refused was refused to the one before
            return self._executor.step(replace(seen, refusal=R.NONE), now=now)
        return view.HAND_BACK if self.is_idle else view.HOLD

    def _note_step(self, before: Task, *, now: float) -> None:
        """See what became of the begun task in this step: it ended, or something halted it."""
        begun = self.begun
        if begun is None:
            self._ended(before.id, now=now)
        elif begun.state is not before.state and begun.state in (S.PAUSED, S.HELD):
            self.halt(begun.reason, actor=SERVER, now=now)

    def _is_interrupted(self, seen: VehicleView, *, now: float) -> bool:
        """Set the running task aside if a waiting one may interrupt it, and could begin."""
        running = self.begun
        if running is None or self._paused or not self._queue or self.is_held_ahead:
            return False
        if now - self._begun_at < self._settings.queueing.preemption_rest:
            return False
        for task_id in self._queue.interrupters():
            if not self._book.is_durable(task_id):
                continue
            waiting = self._book[task_id]
            if self._room.is_too_late(waiting, now=now):
                continue
            if outranks(waiting, running, queueing=self._settings.queueing) and not start_blocker(
                seen,
                watch=self._settings.watch,
                now=now,
                goal=goal_of(waiting),
            ):
                self._executor.pause(R.PREEMPTED, actor=SERVER, now=now)
                self._set_aside(running.id)
                self._begin(waiting, seen, now=now)
                return True
        return False

    def _set_aside(self, task_id: TaskId) -> None:
        self._executor.give_up()
        self._aside[task_id] = None

    def _next(self) -> TaskId | None:
        """The task that has the next turn: the urgent one, a pre-empted one, or a waiting one."""
        if self.is_held_ahead:
            return None
        if self._urgent is not None and self._urgent in self._queue:
            return self._urgent
        if self._paused:
            return None
        first = self._queue.first()
        if not self._aside:
            return first
        resumable = [task for task in self.aside if task.state is S.PAUSED]
        if not resumable:
            return first
        best = min(resumable, key=self._rank)
        if first is not None and self._queue.rank(first) < self._rank(best):
            return first
        return best.id

    def _rank(self, task: Task) -> Rank:
        return self._room.rank(task)

    def _begin_next(self, seen: VehicleView, *, now: float) -> None:
        first = None if self.begun is not None else self._next()
        if first is None:
            return
        task = self._book[first]
        if task.state is S.QUEUED and self._room.is_too_late(task, now=now):
            self._room.handle_deadline(now=now)  # after a delay this may be looked at first
            self._begin_next(seen, now=now)
            return
        blocker = start_blocker(seen, watch=self._settings.watch, now=now, goal=goal_of(task))
        self._note_blocker(first, blocker, now=now)
        if not blocker and self._book.is_durable(first):
            self._begin(task, seen, now=now)

    def _begin(self, task: Task, seen: VehicleView, *, now: float) -> None:
        if task.state is S.QUEUED:
            self._room.leave(task)
        else:
            del self._aside[task.id]
        self._begun_at = now
        if self._is_of_another_frame(task, seen):
            self._executor.adopt(task)
            self._executor.hold(R.FRAME_RESET, now=now)
        elif self._led_away.from_line_of(task, seen):
            self._executor.adopt(task)
            self._executor.hold(R.OFF_LINE, now=now)
        else:
            self._executor.begin(task, actor=SERVER, now=now)

    def _note_blocker(self, first: TaskId, blocker: TaskReason, *, now: float) -> None:
        """Keep why the next task does not begin, and tell of it once each time that it changes."""
        if blocker and (first, blocker) != (self._blocked, self._blocker):
            self._book.record(TaskWaits(first, self.vehicle, blocker, now))
        self._blocked, self._blocker = first, blocker

    def _ended(self, task_id: TaskId, *, now: float) -> None:
        """A task is over. After a failure that had moved the vehicle, somebody should look."""
        task = self._book[task_id]
        if task_id == self._urgent:
            self._urgent = None
        if task.state is S.FAILED and has_moved(task) and self._settings.on_failure == "pause":
            self._pause_queue(task.reason, actor=SERVER, now=now)
        self._room.ended(task_id, now=now)

    def _pause_queue(self, reason: TaskReason, *, actor: str, now: float) -> None:
        if self._paused in (reason, R.STOPPED):
            return
        if self._paused in TAKEN and reason is R.OPERATOR:
            return  # a pause does not say that all is well with the vehicle again
        self._paused = reason
        self._book.record(QueuePaused(self.vehicle, reason, actor, now))
