"""Selects which task of a vehicle starts next, what blocks it, and which one may interrupt."""

from math import inf

from mav_tasks.tasks.driving.mission_sequencer import goal_of
from mav_tasks.tasks.events import SERVER, TaskWaits
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.lineup import Lineup
from mav_tasks.tasks.scheduler import outranks
from mav_tasks.tasks.task import Task, TaskId
from mav_tasks.tasks.view import VehicleView

R, S = TaskReason, TaskState

LEAVES_MODE = 1.5  # s in which a heartbeat shows the mode that was asked for with a task


class Turns:
    """Selector of one vehicle's next task."""

    def __init__(self, lineup: Lineup) -> None:
        self._lineup = lineup
        self._blocker = R.NONE  # why the next task does not start
        self._blocked: TaskId | None = None  # which task that was
        self._told_at = inf  # s, when that is recorded

    def __repr__(self) -> str:
        return f"Turns({self._blocked}, {self._blocker.name})"

    @property
    def awaits_commit(self) -> bool:
        """Whether there is a next task whose submission is not durable yet."""
        first = None if self._lineup.executor.task_id is not None else self.next_id
        return first is not None and not self._lineup.registry.is_durable(first)

    def blocker_of(self, task_id: TaskId) -> TaskReason:
        """Return what blocks the next, an active or a released task; NONE for others."""
        if self._lineup.released is not None and self._lineup.released.task_id == task_id:
            return self._lineup.released.waits_for
        active = self._lineup.active
        if active is not None and active.id == task_id:
            return self._lineup.executor.waits_for[0]
        return self._blocker if self._blocked == task_id else R.NONE

    def words_of_blocker(self, task_id: TaskId) -> str:
        """Return the vehicle's own words for what blocks an active task, or ""."""
        executor = self._lineup.executor
        return executor.waits_for[1] if executor.task_id == task_id else ""

    def is_interrupted(self, seen: VehicleView, *, now: float) -> bool:
        """Let a waiting task pre-empt the running one, if it may and can start. Return whether."""
        lineup = self._lineup
        running, queueing = lineup.active, lineup.settings.queueing
        if running is None or lineup.paused or not lineup.queue or lineup.is_held_ahead:
            return False
        if now - lineup.begun_at < queueing.preemption_rest:
            return False
        for task_id in lineup.queue.interrupters():
            waiting = lineup.registry[task_id]
            is_too_late = lineup.room.times.is_too_late(waiting, now=now)
            if not lineup.registry.is_durable(task_id) or is_too_late:
                continue
            outranked = outranks(waiting, running, queueing=queueing)
            if outranked and not lineup.blocker(seen, goal_of(waiting), now=now):
                lineup.executor.pause(R.PREEMPTED, actor=SERVER, now=now)
                lineup.set_aside(running.id)
                self._begin(waiting, seen, now=now)
                return True
        return False

    def begin_next(self, seen: VehicleView, *, now: float) -> None:
        """Start the next task, if it can start."""
        first = None if self._lineup.active is not None else self.next_id
        if first is None:
            return
        task = self._lineup.registry[first]
        room = self._lineup.room
        if task.state is S.QUEUED and room.times.is_too_late(task, now=now):
            room.handle_deadline(now=now)  # after a delay this may precede its timer
            self.begin_next(seen, now=now)
            return
        blocker = self._lineup.blocker(seen, goal_of(task), now=now)
        self._note_blocker(first, blocker, now=now)
        if not blocker and self._lineup.registry.is_durable(first):
            self._begin(task, seen, now=now)

    @property
    def next_id(self) -> TaskId | None:
        """The next task to start: the immediate one, a pre-empted one, or a waiting one."""
        immediate = self._lineup.immediate
        if immediate is not None and (
            immediate in self._lineup.queue or immediate in self._lineup.suspended_ids
        ):
            return immediate
        if self._lineup.paused or self._lineup.is_held_ahead:
            return None
        first = self._lineup.queue.first()
        if not self._lineup.suspended_ids:
            return first
        rank = self._lineup.room.rank
        best = min(self._lineup.suspended, key=rank)  # all of them are paused: none is held
        if first is not None and self._lineup.queue.rank(first) < rank(best):
            return first
        return best.id

    def _begin(self, task: Task, seen: VehicleView, *, now: float) -> None:
        if task.state is S.QUEUED:
            self._lineup.room.leave(task)
        else:
            del self._lineup.suspended_ids[task.id]
        self._lineup.begun_at = now
        if self._lineup.is_of_another_frame(task, seen):
            self._lineup.executor.adopt(task)
            self._lineup.executor.hold(R.FRAME_RESET, now=now)
        elif self._lineup.displaced.from_line_of(task, seen):
            self._lineup.executor.adopt(task)
            self._lineup.executor.hold(R.OFF_TRACK, now=now)
        else:
            self._lineup.executor.begin(task, actor=SERVER, now=now)

    def _note_blocker(self, first: TaskId, blocker: TaskReason, *, now: float) -> None:
        """Note why the next task does not start, and record it each time that it changes."""
        if (first, blocker) != (self._blocked, self._blocker):
            self._told_at = now + (LEAVES_MODE if blocker is R.WRONG_MODE else 0.0)
        self._blocked, self._blocker = first, blocker
        if blocker and now >= self._told_at:
            self._told_at = inf
            self._lineup.registry.record(TaskWaits(first, self._lineup.vehicle, blocker, now))
