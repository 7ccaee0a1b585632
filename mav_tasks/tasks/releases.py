"""Releases of held tasks: checks of the remainder, and what a released task waits for."""

from dataclasses import replace

from mav_tasks.errors import Rejection
from mav_tasks.tasks.driving.legs import leg_of
from mav_tasks.tasks.driving.mission_sequencer import goal_of, has_local_place
from mav_tasks.tasks.driving.stage import is_off_line
from mav_tasks.tasks.events import TaskWaits, VehicleNoted
from mav_tasks.tasks.goal import MoveTurned, Rotate
from mav_tasks.tasks.lifecycle import CONTINUE_FIRST, TaskReason, TaskState, words_of
from mav_tasks.tasks.lineup import Lineup, Released
from mav_tasks.tasks.task import Task, same_frame
from mav_tasks.tasks.view import VehicleView

R, S = TaskReason, TaskState

#: the vehicle, or the server, has restarted in the middle of the task
AFTER_RESTART = frozenset({R.FRAME_RESET, R.OUTCOME_UNKNOWN})
#: what a release waits for then
OF_RESTART = frozenset({R.VEHICLE_SILENT, R.NO_POSITION})


class Releases:
    """Handler of the releases of one vehicle's held tasks; one release waits at a time."""

    def __init__(self, lineup: Lineup) -> None:
        self._lineup = lineup

    def __repr__(self) -> str:
        return f"Releases({self._lineup.released})"

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
        if self._lineup.is_stopped:
            raise Rejection(R.STOPPED, CONTINUE_FIRST)
        active = self._lineup.active
        if active is not None and active.id != task.id and active.state not in (S.HELD, S.PAUSED):
            words = f"task {active.id} is {active.state.name.lower()}: release task {task.id} later"
            raise Rejection(R.WRONG_STATE, words)
        waits_for = self._waits_for(task, seen, may_continue=may_continue, now=now)
        if not waits_for:
            self._lineup.check_start(seen, goal_of(task), now=now)
        if not again:
            self._check_remainder(task, seen)
        if active is not None and active.id != task.id:
            self._lineup.set_aside(active.id)
        if self._lineup.active is None:
            self._lineup.suspended_ids.pop(task.id, None)
            self._lineup.executor.adopt(task)
        self._lineup.of_earlier_run.discard(task.id)
        if waits_for:
            until = now + self._lineup.settings.watch.ready_timeout
            term = self._lineup.halts.term
            self._lineup.last_released = Released(
                task.id, again, may_continue, actor, until, waits_for, term
            )
            self._lineup.registry.record(TaskWaits(task.id, self._lineup.vehicle, waits_for, now))
            return
        self._begin_released(again=again, actor=actor, now=now)

    def look(self, seen: VehicleView, *, now: float) -> None:
        """Start a released task once nothing blocks it; hold it as before if it cannot start."""
        release, task = self._lineup.released, self._lineup.active
        if release is None:
            return
        if task is None or task.id != release.task_id or task.state is not S.HELD:
            self._lineup.last_released = None
            return
        waits_for = self._waits_for(task, seen, may_continue=release.may_continue, now=now)
        if not waits_for:
            try:
                self._lineup.check_start(seen, goal_of(task), now=now)
            except Rejection as refusal:
                self._note_held(task, refusal.text, now=now)
            else:
                self._begin_released(again=release.again, actor=release.actor, now=now)
        elif now >= release.until and waits_for is not R.QUEUE_PAUSED:
            self._note_held(task, f"waited too long ({words_of(waits_for)})", now=now)
        elif waits_for is not release.waits_for:
            self._lineup.last_released = replace(release, waits_for=waits_for)
            self._lineup.registry.record(TaskWaits(task.id, self._lineup.vehicle, waits_for, now))

    def _begin_released(self, *, again: bool, actor: str, now: float) -> None:
        self._lineup.last_released = None
        self._lineup.executor.release(again=again, actor=actor, now=now)
        self._lineup.begun_at = now

    def _waits_for(
        self, task: Task, seen: VehicleView, *, may_continue: bool, now: float
    ) -> TaskReason:
        """Return what a released task waits for: the queue, or a reboot; NONE if it can start."""
        if self._lineup.paused and not (self._lineup.paused is R.RESTARTED and may_continue):
            return R.QUEUE_PAUSED
        if task.reason not in AFTER_RESTART:
            return R.NONE
        if seen.heard and seen.is_booting:  # it shows another mode for a moment
            return R.NO_POSITION
        if seen.is_engaged:  # it is still being put in HOLD
            return R.NOT_READY
        blocker = self._lineup.blocker(seen, goal_of(task), now=now)
        return blocker if blocker in OF_RESTART else R.NONE

    def _note_held(self, task: Task, why: str, *, now: float) -> None:
        self._lineup.last_released = None
        words = f"holds task {task.id} again: {why}. Release it again"
        self._lineup.registry.record(VehicleNoted(self._lineup.vehicle, words, now))

    def _check_remainder(self, task: Task, seen: VehicleView) -> None:
        """Raise Rejection unless the remainder is known, on its line or by what was counted."""
        progress = task.progress
        if task.reason is R.FRAME_RESET and has_local_place(task.goal):
            words = f"the position reference of task {task.id} is lost: choose again or skip"
            raise Rejection(R.WRONG_STATE, words)
        counts_from_here = task.reason in (R.FRAME_RESET, R.OFF_TRACK)
        if not counts_from_here and seen.motion and is_off_line(task, seen.motion.pose):
            words = f"the rover is off the path of task {task.id}: choose again or skip"
            raise Rejection(R.OFF_TRACK, words)
        if task.reason is not R.OUTCOME_UNKNOWN or progress.anchor is None:
            return
        goal = goal_of(task)
        leg = leg_of(goal, progress) if isinstance(goal, Rotate | MoveTurned) else None
        turned = isinstance(leg, Rotate) and abs(leg.angle) > 3.0
        if turned or not same_frame(progress.frame, seen.frame):
            words = f"the progress of task {task.id} is unknown: choose again or skip"
            raise Rejection(R.WRONG_STATE, words)
