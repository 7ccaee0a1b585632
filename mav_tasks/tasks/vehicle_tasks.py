"""The tasks of one vehicle: requests that change them, and what they demand of the vehicle.

It knows no protocol: ``step`` returns what the vehicle must be made to do.
"""

from collections.abc import Container, Iterable
from dataclasses import replace
from math import inf

from mav_tasks.basics.errors import Rejection
from mav_tasks.tasks import view
from mav_tasks.tasks.driving.executor import has_moved
from mav_tasks.tasks.driving.mission_sequencer import (
    goal_of,
    has_local_place,
    present_goal,
    skipped_to,
)
from mav_tasks.tasks.driving.stage import is_off_line
from mav_tasks.tasks.events import SERVER, QueueContinued, VehicleHalted
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.halts import BY_SOMEBODY, NOBODY, LastHalt
from mav_tasks.tasks.lifecycle import (
    CONTINUE_FIRST,
    TAKEN,
    WAITING,
    TaskReason,
    TaskState,
    words_of,
)
from mav_tasks.tasks.lineup import Lineup, Released
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Draft, Progress, Task, TaskId, Terms, same_frame
from mav_tasks.tasks.view import Demand, VehicleView

R, S = TaskReason, TaskState

#: the vehicle, or the server, has restarted in the middle of the task
AFTER_RESTART = frozenset({R.FRAME_RESET, R.OUTCOME_UNKNOWN})
#: what a release waits for then
OF_RESTART = frozenset({R.VEHICLE_SILENT, R.NO_POSITION})


class VehicleTasks(Lineup):
    """All tasks of the vehicle with this system id."""

    # requests

    def restore(
        self,
        tasks: Iterable[Task],
        restored: Restored,
        *,
        paused: TaskReason,
        resuming: Container[TaskId] = (),
        now: float,
    ) -> None:
        """Load the active and suspended tasks of an earlier run; those ``resuming`` go on alone."""
        vehicle = self.vehicle
        last = LastHalt(*restored.halted.get(vehicle, NOBODY))
        by_somebody = last if last.reason in BY_SOMEBODY else NOBODY
        self.halts.restore(restored.halt_epochs.get(vehicle, 1), by_somebody, now=now)
        self.halt(R.RESTARTED, now=now)
        self.paused, self.speed = paused, restored.speeds.get(vehicle)
        self.uid = restored.uids.get(vehicle, "")
        self.may_be_armed = vehicle not in restored.disarmed
        self._apply_driving()
        # the one that changed last had the vehicle
        for task in sorted(tasks, key=lambda task: task.changed_at or -inf, reverse=True):
            self.of_earlier_run.add(task.id)
            if self.active is not None or task.reason is R.PREEMPTED:
                self.suspended_ids[task.id] = True  # who moved it meanwhile is not known
            elif task.id in resuming:
                self.executor.take_over(task, now=now)
            else:
                self.executor.adopt(task)
        if paused is R.STOPPED and last.reason is R.STOPPED:
            # the earlier run has done so, but its last events may not have been stored
            self._repeat_nothing(R.STOP, now=now, since=last.at)
        if ended_by := restored.stopped.get(vehicle):
            # the earlier run has done this, but only the record of halts knows that
            killed = self._kill_what_drives(spares_missions=ended_by is R.STOP, now=now)
            if ended_by is R.STOPPED:
                self._repeat_nothing(R.STOP, now=now)
            if killed is not None:
                self.room.ended(killed, now=now)

    def belong_to_another(self, *, now: float) -> None:
        """Hold and pause these tasks: another vehicle answers at the address of theirs."""
        self._end_cancelling(now=now)
        self.hold(R.FRAME_RESET, now=now)
        self._wait_for_somebody(now=now)
        self.stopping_after_kill = False

    def unidentified(self, *, now: float) -> None:
        """Pause these tasks: their vehicle has a unique id, and this one reports none."""
        self.uid = ""
        if not self.is_empty:
            self._wait_for_somebody(now=now)

    def _wait_for_somebody(self, *, now: float) -> None:
        """Start nothing before somebody has looked which vehicle this is."""
        self.halt(R.RESTARTED, now=now)
        if not self.is_empty:
            self.executor.pause(R.OPERATOR, now=now)
            self.pause_queue(R.RESTARTED, now=now)

    def _end_cancelling(self, *, actor: str = SERVER, now: float) -> None:
        """End a CANCELLING task without waiting for standstill."""
        if (ended := self.executor.let_go(actor=actor, now=now)) is not None:
            self._ended(ended, now=now)

    def run_now(self, draft: Draft, seen: VehicleView, *, actor: str, now: float) -> TaskId:
        """Add a task that runs at once; all others wait until the queue is resumed.

        Return its id. Raise Rejection if it cannot start now: it must not start later, when
        somebody parks the vehicle.
        """
        if self.is_stopped:
            raise Rejection(R.STOPPED, CONTINUE_FIRST)
        self.check_start(seen, present_goal(draft.goal, Progress()), now=now)
        task = self.room.submit(draft, now=now)
        self.give_way_to(task, actor=actor, now=now)
        return task.id

    def give_way_to(self, task: Task, *, actor: str, now: float) -> None:
        """Run a waiting task at once; all others, if any, wait until the queue is resumed.

        It replaces the clicks of its submitter: nobody sees them any more.
        """
        for click in self.unfinished:
            if click.is_click and click.id != task.id and click.submitter == task.submitter:
                self._end(click, S.CANCELLED, R.REPLACED, actor=actor, now=now)
        active = self.active
        if active is not None and active.id == self.immediate:
            self.executor.cancel(R.REPLACED, actor=actor, now=now)
        elif active is not None and active.state is not S.CANCELLING:
            self.executor.pause(R.OPERATOR, actor=actor, now=now)
            self.set_aside(active.id)
        before = None if self.immediate is None else self.registry.get(self.immediate)
        if before is not None and before.id != task.id and before.state in WAITING:
            self.room.end(before, S.CANCELLED, R.REPLACED, actor=actor, now=now)
        self.immediate = task.id
        if self.has_others:
            self.pause_queue(R.OPERATOR, actor=actor, now=now)

    @property
    def has_others(self) -> bool:
        """Whether any task could start beside the immediate one."""
        return any(
            each.id != self.immediate
            and each.state is not S.CANCELLING
            and not each.terms.is_staged
            for each in self.unfinished
        )

    def cancel(self, task: Task, *, kill: bool, reason: TaskReason, actor: str, now: float) -> None:
        """Cancel a task, or end it at once (``kill``); the vehicle stands before anything starts.

        A vehicle that somebody else has is not made to stand: STOP does that. The end of a
        task that another one replaces halts nothing: who replaces it wants the other one driven.
        """
        rests = task.state in WAITING or task.id in self.suspended_ids
        if not rests and reason is not R.REPLACED:
            self.halt(reason, actor=actor, now=now)
        self._end(task, S.KILLED if kill else S.CANCELLED, reason, actor=actor, now=now)

    def _end(
        self, task: Task, state: TaskState, reason: TaskReason, *, actor: str, now: float
    ) -> None:
        kill = state is S.KILLED
        if task.state in WAITING:
            self.room.end(task, state, reason, actor=actor, now=now)
        elif task.id in self.suspended_ids:
            del self.suspended_ids[task.id]
            if task.state is S.PAUSED and not kill:
                self.registry.change(task.id, S.CANCELLING, reason=reason, actor=actor, now=now)
            self.registry.change(task.id, state, reason=reason, actor=actor, now=now)
            self.room.ended(task.id, now=now)
        else:
            if kill:
                others = task.reason in TAKEN  # somebody else has the vehicle
                others |= self.paused in TAKEN and task.reason is R.FRAME_RESET
                self.stopping_after_kill |= not others
                self.executor.kill(reason, actor=actor, now=now)
            else:
                self.executor.cancel(reason, actor=actor, now=now)
            if self.active is None:
                self._ended(task.id, now=now)

    def modify(self, task: Task, terms: Terms, *, actor: str, now: float) -> None:
        """Change a task's terms. Raise Rejection if its dependency cannot complete."""
        if terms == task.terms:
            return
        if task.state in WAITING:
            self.room.modify(task, terms, actor=actor, now=now)
        else:
            self.registry.modify(task.id, terms, actor=actor, now=now)

    def clear(self, *, begun_too: bool, actor: str, now: float) -> None:
        """Cancel the waiting tasks; with ``begun_too`` the active and suspended ones, too."""
        self.room.clear(self.vehicle, R.CLEARED, actor=actor, now=now)
        self._repeat_nothing(R.CLEARED, actor=actor, now=now)
        if begun_too:
            active = [] if self.active is None else [self.active]
            for task in self.suspended + active:
                self.cancel(task, kill=False, reason=R.CLEARED, actor=actor, now=now)

    def skip_to(self, task: Task, step: int, *, now: float) -> None:
        """Continue, or start, an unfinished plan at another of its steps."""
        assert isinstance(task.goal, Plan), "only plans have steps"
        progress = skipped_to(task.goal, replace(self.registry[task.id].progress, pending=()), step)
        self.go_on_at(task, progress, now=now)

    def go_on_at(self, task: Task, progress: Progress, *, now: float) -> None:
        """Continue, or start, an unfinished task at this progress, once that is durable."""
        if self.executor.task_id == task.id:
            self.executor.drive.forget()
        self.registry.advance(task.id, progress, now=now)
        self.registry.hold_back(task.id)

    def rest(self, seen: VehicleView, *, now: float) -> None:
        """Record how far the vehicle rolled after it was stopped for the end of the server."""
        active = self.active
        if seen.motion is not None and active is not None and active.state is S.PAUSED:
            self.executor.drive.rest(active, seen.motion, now=now)

    def pause(self, reason: TaskReason, *, actor: str, now: float) -> TaskId | None:
        """Pause the active task and the queue. Return the task's id, or None. Never undo a STOP.

        If somebody else has the vehicle, a CANCELLING task ends without waiting for standstill.
        """
        self.halt(reason, actor=actor, now=now)
        self.executor.pause(reason, actor=actor, now=now)
        self.pause_queue(reason, actor=actor, now=now)
        if reason in TAKEN:
            self._end_cancelling(actor=actor, now=now)
        return self.executor.task_id

    def proceed(
        self, seen: VehicleView, *, actor: str, now: float, allows: bool = False
    ) -> TaskId | None:
        """Release the STOP latch or any other pause. Return the id of the resumed task, or None.

        Raise Rejection, and change nothing, if the task to resume could not take the vehicle now. A
        held task keeps blocking the queue. Raise Rejection also if only a held task blocks it and
        the request does not allow arming again (``allows``): then there is nothing to resume.
        """
        held = self.held
        active = self.active if held is None else None
        resumed = active if active is not None and active.state is S.PAUSED else None
        if held is not None and not self.paused and not allows:
            words = (
                f"task {held.id} is held ({words_of(held.reason)}): release it"
                " (again, remainder or skip)"
            )
            raise Rejection(R.WRONG_STATE, words)
        if resumed is not None:
            self.check_start(seen, goal_of(resumed), now=now)
        if self.paused or self.halts.by_somebody is not NOBODY:
            self.paused = R.NONE
            self.halts.lets_go()
            self.registry.record(QueueContinued(self.vehicle, actor, now))
            self._put_held_first()
        if resumed is not None and self.is_of_another_frame(resumed, seen):
            self.executor.hold(R.FRAME_RESET, now=now)
        elif resumed is not None:
            self.executor.resume(seen, actor=actor, now=now)
            self._begun_at = now
        return None if active is None else active.id

    def _put_held_first(self) -> None:
        """Suspend a paused active task for a held one: its turn comes after the decision."""
        active, held = self.active, self.held
        if active is None or held is None or active.state is not S.PAUSED:
            return
        if not self.executor.resumes_by_itself:
            self.set_aside(active.id)
            self.suspended_ids[active.id] = True  # it goes on from its line only
            del self.suspended_ids[held.id]
            self.executor.adopt(held)

    def hold(self, reason: TaskReason, *, now: float) -> None:
        """Hold the active task until a client decides.

        FRAME_RESET also holds the paused tasks that had started a leg: their lines are lost, too.
        """
        if self.is_driving:
            self.halt(reason, now=now)
        self.executor.hold(reason, now=now)
        if reason is R.FRAME_RESET:
            for task in self.suspended:
                if task.state is S.PAUSED and task.progress.anchor is not None:
                    self.registry.change(task.id, S.HELD, reason=reason, now=now)

    def restarted(self, *, was_paused: TaskReason, now: float) -> bool:
        """Hold the tasks of a vehicle that has rebooted, and pause the queue until it is resumed.

        Return whether a person must look at it first: a task has driven it, perhaps one that was
        being cancelled. One that has not moved starts again by itself. ``was_paused`` is why the
        queue was paused before the vehicle showed disarmed: the reboot disarmed it, no takeover.
        """
        was_driving = self.is_driving
        self._end_cancelling(now=now)
        if not self.suspended_ids and self.executor.begins_again(now=now):
            return False
        self.hold(R.FRAME_RESET, now=now)
        if was_driving and not was_paused:
            self.pause_queue(R.RESTARTED, now=now)
        return was_driving

    def stop(self, *, clear: bool, actor: str, now: float) -> TaskId | None:
        """Kill the active task and latch STOP; with ``clear`` cancel the others. Return its id.

        STOP ends each series, also one that waits for its time: after a resume hours later the
        vehicle would start by itself, and nobody would think of it.
        """
        self.halt(R.STOPPED, actor=actor, now=now)
        killed = self._kill_what_drives(actor=actor, now=now)
        self.pause_queue(R.STOPPED, actor=actor, now=now)
        if clear:
            self.clear(begun_too=True, actor=actor, now=now)
        self._repeat_nothing(R.STOP, actor=actor, now=now)
        if killed is not None:
            self.room.ended(killed, now=now)
        return killed

    def end_what_drives(self, *, actor: str, now: float) -> None:
        """End the active task and the clicks: a ground station has made an emergency stop.

        A mission at the autopilot's address stays, for ground stations show it. What stays waits.
        """
        # for the record of halts; the disarming that follows is the halt
        self.registry.record(VehicleHalted(self.vehicle, self.halts.epoch, R.STOP, actor, now))
        killed = self._kill_what_drives(spares_missions=True, actor=actor, now=now)
        if killed is not None:
            self._ended(killed, now=now)
        if self.has_others:
            self.pause_queue(R.OPERATOR, actor=actor, now=now)

    def _kill_what_drives(
        self, *, spares_missions: bool = False, actor: str = SERVER, now: float
    ) -> TaskId | None:
        """End the active task and all clicks; return the id of the former, or None.

        Nobody who has stopped the vehicle sees where a click would lead.
        """
        task = self.active
        is_mission = task is not None and isinstance(task.goal, Plan) and task.terms.is_cruising
        is_spared = spares_missions and is_mission
        killed = None if is_spared else self.executor.kill(R.STOP, actor=actor, now=now)
        for task in self.unfinished:
            if task.is_click:
                self._end(task, S.KILLED, R.STOP, actor=actor, now=now)
        self.immediate = None
        return killed

    def _repeat_nothing(
        self, reason: TaskReason, *, actor: str = SERVER, now: float, since: float = inf
    ) -> None:
        """End each series: its waiting run ends, one that has started does not repeat.

        One that was submitted after ``since`` goes on.
        """
        for task in self.registry.runs_of(self.vehicle):
            if task.submitted_at > since:
                continue
            if task.state in WAITING:
                self.room.end(task, S.KILLED, reason, actor=actor, now=now)
            else:
                self.registry.repeat_no_more(task.id, actor=actor, now=now)

    # releases of held tasks

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
        """Resume a held task from here: all of it (``again``), or its remainder.

        Raise Rejection, and change nothing, if the task could not take the vehicle now. If the
        queue is paused, or the vehicle or the server has restarted and the vehicle is not ready,
        the task waits for that, for ``ready_timeout`` at most, or until something halts it. It does
        not wait for a queue that is paused for a restart if the client ``may_continue`` it.
        """
        if self.is_stopped:
            raise Rejection(R.STOPPED, CONTINUE_FIRST)
        active = self.active if self.executor.task_id != task.id else None
        if active is not None and active.state not in (S.HELD, S.PAUSED):
            words = f"task {active.id} is {active.state.name.lower()}: release task {task.id} later"
            raise Rejection(R.WRONG_STATE, words)
        waits_for = self._waits_for(task, seen, may_continue=may_continue, now=now)
        if not waits_for:
            self.check_start(seen, goal_of(task), now=now)
        if not again:
            _check_remainder(task, seen)
        if active is not None:
            self.set_aside(active.id)
        if self.active is None:
            self.suspended_ids.pop(task.id, None)
            self.executor.adopt(task)
        self.of_earlier_run.discard(task.id)
        until = now + self.settings.watch.ready_timeout
        self.release_permit.give(Released(task.id, again, may_continue, actor, until, R.NONE))
        self._look_at_released(seen, now=now)

    def _look_at_released(self, seen: VehicleView, *, now: float) -> None:
        """Start a released task once nothing blocks it; hold it as before if it cannot start."""
        if (release := self.released) is None:
            return
        task = self.active
        if task is None or task.id != release.task_id or task.state is not S.HELD:
            self.release_permit.end()
            return
        waits_for = self._waits_for(task, seen, may_continue=release.may_continue, now=now)
        why_not = ""
        if not waits_for:
            try:
                self.check_start(seen, goal_of(task), now=now)
            except Rejection as refusal:
                why_not = refusal.text
        elif now >= release.until and waits_for is not R.QUEUE_PAUSED:
            why_not = f"waited too long ({words_of(waits_for)})"
        if why_not:
            self.release_permit.end()
            words = f"holds task {task.id} again: {why_not}. Release it again"
            self.registry.note(self.vehicle, words, now=now)
        elif not waits_for:
            self.release_permit.end()
            self.executor.release(task, again=release.again, actor=release.actor, now=now)
            self._begun_at = now
        elif waits_for is not release.waits_for:
            self.release_permit.give(release._replace(waits_for=waits_for))
            self._tell_wait(task.id, waits_for, now=now)

    def _waits_for(
        self, task: Task, seen: VehicleView, *, may_continue: bool, now: float
    ) -> TaskReason:
        """Return what a released task waits for: the queue, or a reboot; NONE if it can start."""
        if self.paused and not (self.paused is R.RESTARTED and may_continue):
            return R.QUEUE_PAUSED
        if task.reason not in AFTER_RESTART:
            return R.NONE
        if seen.heard and seen.is_booting:  # it shows another mode for a moment
            return R.NO_POSITION
        if seen.is_engaged:  # it is still being put in HOLD
            return R.NOT_READY
        blocker = self.blocker(seen, goal_of(task), now=now)
        return blocker if blocker in OF_RESTART else R.NONE

    # time

    def step(self, seen: VehicleView, *, now: float) -> Demand:
        """Start the tasks that can start. Return what the vehicle must be made to do now."""
        self.seen = seen
        if self._jumps.has_jumped(seen.motion, driving=self.settings.driving) and self.is_driving:
            self.hold(R.FRAME_RESET, now=now)
        if self.is_stopped:
            return view.STOP
        if self.stopping_after_kill:
            if not seen.still:
                return view.HALT
            self.stopping_after_kill = False
        self._look_at_released(seen, now=now)
        before, executor = self.active, self.executor
        if before is not None and seen.in_control:
            self.note_moved(seen)
            self._left = seen.motion
        demand = executor.step(seen, now=now)
        if before is not None:
            self._note_step(before, now=now)
        if executor.task_id is not None and not self.is_interrupted(seen, now=now):
            return demand
        self.begin_next(seen, now=now)
        if executor.task_id is not None:  # the refusal was for the task before
            if not self.paused:  # the person who halted it has not paused its queue
                self.halts.by_somebody = NOBODY
            return executor.step(replace(seen, refusal=R.NONE), now=now)
        return view.HAND_BACK if self.is_idle else view.HOLD

    def _note_step(self, before: Task, *, now: float) -> None:
        """Handle a task that ended or was interrupted in this step."""
        active = self.active
        if active is None:
            self._ended(before.id, now=now)
        elif active.state is not before.state and active.state in (S.PAUSED, S.HELD):
            self.halt(active.reason, now=now)

    def _ended(self, task_id: TaskId, *, now: float) -> None:
        """Handle the end of a task. Pause the queue after a failure that had moved the vehicle."""
        task = self.registry[task_id]
        if task_id == self.immediate:
            self.immediate = None
        if task.state is S.FAILED and has_moved(task) and self.settings.on_failure == "pause":
            self.pause_queue(task.reason, now=now)
        self.room.ended(task_id, now=now)


def _check_remainder(task: Task, seen: VehicleView) -> None:
    """Raise Rejection unless the remainder is known, on its line or by what was counted."""
    again = "choose again or skip"
    if task.reason is R.FRAME_RESET and has_local_place(task.goal):
        words = f"the position reference of task {task.id} is lost: {again}"
        raise Rejection(R.WRONG_STATE, words)
    counts_from_here = task.reason in (R.FRAME_RESET, R.OFF_TRACK)
    if not counts_from_here and seen.motion and is_off_line(task, seen.motion.pose):
        raise Rejection(R.OFF_TRACK, f"the rover is off the path of task {task.id}: {again}")
    progress, goal = task.progress, goal_of(task)
    if task.reason is not R.OUTCOME_UNKNOWN or progress.anchor is None:
        return
    if goal.loses_count(progress) or not same_frame(progress.frame, seen.frame):
        raise Rejection(R.WRONG_STATE, f"the progress of task {task.id} is unknown: {again}")
