"""The tasks of all vehicles that have not started: start times, deadlines, dependencies, queues.

One object holds them all, because a task can depend on a task of another vehicle. A ready task is
in its vehicle's queue. A task inherits the rank of the most urgent task that depends on it,
directly or through others.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

from mav_tasks.errors import Rejection
from mav_tasks.settings import Settings
from mav_tasks.tasks.cron import utc_text
from mav_tasks.tasks.dependencies import Dependencies
from mav_tasks.tasks.events import SERVER, VehicleNoted
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.queue import Entry, Rank, TaskQueue, rank_of
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.repetition import (
    CORRECTION,
    brought_forward,
    left_out_words,
    next_run,
    why_series_ends,
)
from mav_tasks.tasks.task import Draft, QueuePlace, Submitter, Task, TaskId, Terms
from mav_tasks.tasks.times import Times

R, S = TaskReason, TaskState


@dataclass(slots=True)
class _Waiter:
    """Data of one waiting task that the registry does not have."""

    came_at: float  # when it began to compete with others: submission, or start time
    own: Rank
    rank: Rank  # its own, or that of a more urgent dependent
    is_met: bool = False  # its dependency: that has completed, also if nobody knows it any more


class PendingTasks:
    """Store of the tasks in SCHEDULED, BLOCKED and QUEUED."""

    def __init__(self, registry: TaskRegistry, settings: Settings) -> None:
        self._registry = registry
        self._settings = settings
        self._waiters: dict[TaskId, _Waiter] = {}
        self._queues: dict[int, TaskQueue] = defaultdict(TaskQueue)
        self._of_vehicle: dict[int, int] = {}  # how many wait
        self._of_owner: dict[str, int] = {}
        self._dependencies = Dependencies(registry)
        #: start times and deadlines
        self.times = Times()
        #: the vehicles whose tasks became ready or left since ``take_woken``
        self.woken: set[int] = set()

    def __repr__(self) -> str:
        return f"PendingTasks({len(self._waiters)} tasks)"

    def apply(self, settings: Settings) -> None:
        """Apply new settings; tasks that already wait keep their order."""
        self._settings = settings

    def share(self) -> None:
        """Take that tasks may run after those of other gateways' vehicles."""
        self._dependencies.is_shared = True

    def queue(self, vehicle: int) -> TaskQueue:
        """Return the queue of a vehicle's ready tasks."""
        return self._queues[vehicle]

    def count(self, vehicle: int) -> int:
        """Return how many tasks of a vehicle wait, ready or not."""
        return self._of_vehicle.get(vehicle, 0)

    def count_of(self, submitter: Submitter) -> int:
        """Return how many tasks of a submitter's owner wait."""
        return self._of_owner.get(submitter.owner, 0)

    def of(self, vehicle: int) -> list[TaskId]:
        """Return all waiting tasks of a vehicle: the ready ones in order, then the others."""
        ready = self.queue(vehicle).in_order()
        if len(ready) == self.count(vehicle):
            return ready

        def due_or_rank(task_id: TaskId) -> tuple[float, Rank]:
            return self.times.start(self._registry[task_id].terms), self._waiters[task_id].rank

        others = [
            task_id
            for task_id in self._waiters
            if self._registry[task_id].vehicle == vehicle and task_id not in self.queue(vehicle)
        ]
        return ready + sorted(others, key=due_or_rank)

    def rank(self, task: Task) -> Rank:
        """Return a task's rank among the ready ones; for an active task, the rank it would have."""
        if waiter := self._waiters.get(task.id):
            return waiter.rank
        return self._most_urgent(task.id, _own_rank(self._settings, task, task.submitted_at))

    def take_woken(self) -> set[int]:
        """Return the vehicles whose tasks became ready or left since the last call."""
        woken, self.woken = self.woken, set()
        return woken

    # arrival

    def submit(self, draft: Draft, *, now: float) -> Task:
        """Add a new task. Raise Rejection at a limit, or if its dependency cannot complete."""
        queueing = self._settings.queueing
        if self._of_vehicle.get(draft.vehicle, 0) >= queueing.capacity:
            raise Rejection(R.QUEUE_FULL, f"queue full: {queueing.capacity} tasks wait")
        if self._of_owner.get(draft.submitter.owner, 0) >= queueing.quota:
            raise Rejection(R.QUOTA, f"quota: this client has {queueing.quota} waiting tasks")
        if draft.terms.after:
            self._dependencies.check(draft.terms.after)
        return self._add(draft, now=now)

    def _add(self, draft: Draft, *, now: float) -> Task:
        is_met = self._dependencies.has_completed(draft.terms.after)
        state = self._state_by(draft.terms, is_met=is_met, now=now)
        task = self._registry.submit(draft, state=state, now=now)
        self._enter(task, draft.submitter.owner, now=now)
        if state is S.QUEUED:  # wakes nobody: it is not durable yet
            self._line_up(task)
        return task

    def restore(self, tasks: Iterable[Task], *, now: float) -> None:
        """Add those tasks of an earlier run that were waiting."""
        waiting = [task for task in tasks if task.state in WAITING]
        waiting = [self._moved_on(task, now=now) for task in waiting]
        for task in waiting:
            due = self.times.start(task.terms)
            came_at = max(task.submitted_at, due) if due <= now else task.submitted_at
            self._enter(task, task.submitter.owner, now=came_at)
            if task.id in self._dependencies:  # a modification may have put dependents first
                self._lift(task.id)
        ready: dict[int, list[Entry]] = {}
        others: list[Task] = []
        for task in waiting:
            if task.state is S.QUEUED and self._wanted(task, now=now) is S.QUEUED:
                ready.setdefault(task.vehicle, []).append(self._entry(task))
            else:
                others.append(task)
        for vehicle, entries in ready.items():
            self.queue(vehicle).put_all(entries)
        for task in others:
            if task.id not in self._waiters or task.id in self.queue(task.vehicle):
                continue
            if self._dependencies.have_failed(task):  # failure was stored, its consequence was not
                self._fail(task.id, now=now)
                self.ended(task.id, now=now)
            else:
                self._settle(task, now=now)
        self._look_again(now=now)

    def _enter(self, task: Task, owner: str, *, now: float) -> None:
        own = _own_rank(self._settings, task, now)
        self._waiters[task.id] = _Waiter(now, own, own)
        self._of_vehicle[task.vehicle] = self._of_vehicle.get(task.vehicle, 0) + 1
        self._of_owner[owner] = self._of_owner.get(owner, 0) + 1
        self.times.note(task)
        if task.terms.after:
            self._depend(task)
            self._lift(task.id)

    def _depend(self, task: Task) -> None:
        """Note what a waiting task runs after, unless that has completed."""
        after, known = task.terms.after, self._dependencies
        is_met = known.has_completed(after) or known.was_met(task)
        self._waiters[task.id].is_met = is_met
        if after and not is_met:
            known.add(task.id, after)

    # changes of state

    def _settle(self, task: Task, *, now: float) -> Task:
        """Move a waiting task to the state and queue that its terms require now."""
        wanted = self._wanted(task, now=now)
        if task.state is S.SCHEDULED and wanted is not S.SCHEDULED and task.terms.repeat:
            task = self._moved_on(task, now=now)  # the clock may have passed more than one run
            wanted = self._wanted(task, now=now)
            self.times.note(task)
        if task.state is S.SCHEDULED and wanted is not S.SCHEDULED:
            waiter = self._waiters[task.id]
            waiter.came_at = max(waiter.came_at, self.times.start(task.terms))
            self._rerank(task)
        if task.state is not wanted:
            task = self._registry.change(task.id, wanted, reason=R.NONE, actor=SERVER, now=now)
        if wanted is S.QUEUED:
            self._line_up(task)
            self.woken.add(task.vehicle)
        else:
            self.queue(task.vehicle).discard(task.id)
        return task

    def _line_up(self, task: Task) -> None:
        self._queues[task.vehicle].put(self._entry(task))

    def _entry(self, task: Task) -> Entry:
        rank = self._waiters[task.id].rank
        return Entry(task.id, rank, task.terms.priority, task.terms.is_preemptive)

    def _wanted(self, task: Task, *, now: float) -> TaskState:
        return self._state_by(task.terms, is_met=self._waiters[task.id].is_met, now=now)

    def _state_by(self, terms: Terms, *, is_met: bool, now: float) -> TaskState:
        has_start = terms.start_at is not None or terms.start_utc is not None
        if has_start and self.times.start(terms) > now:
            return S.SCHEDULED
        after = 0 if is_met else terms.after
        if terms.is_staged or (after and self._dependencies.is_waited_for(after)):
            return S.BLOCKED
        return S.QUEUED

    def handle_deadline(self, *, now: float) -> None:
        """Expire tasks whose deadline has passed, and settle those whose start time has come."""
        for task_id in self.times.deadlines.take(now=now):
            if task := self._waiting(task_id):
                self.end(task, S.EXPIRED, R.DEADLINE, actor=SERVER, now=now)
        for task_id in self.times.starts.take(now=now):
            self._settle(self._registry[task_id], now=now)

    def set_wall_offset(self, offset: float, *, now: float) -> None:
        """Set UTC minus monotonic time, s; this moves the tasks that start at a UTC time."""
        waiting = [self._registry[task_id] for task_id in self._waiters]
        is_corrected = self.times.wall_offset - offset > CORRECTION
        self.times.set_wall_offset(offset, waiting)
        if is_corrected:
            waiting = [self._brought_forward(task, now=now) for task in waiting]
        for task in waiting:
            if task.terms.start_utc is not None:
                self._settle(task, now=now)

    def modify(self, task: Task, terms: Terms, *, actor: str, now: float) -> None:
        """Change the terms of a waiting task. Raise Rejection if its dependency cannot complete."""
        if terms.after and terms.after != task.terms.after:
            self._dependencies.check_here(terms.after)
            self._dependencies.check_cycle(task, terms.after)
        before = task.terms.after
        if task.terms.is_staged and not terms.is_staged:
            self._waiters[task.id].came_at = now  # it has not competed with others until now
        task = self._registry.modify(task.id, terms, actor=actor, now=now)
        self.times.note(task)
        if before != terms.after:
            self._part(task.id, before)
            self._depend(task)
        self._rerank(task)
        self.queue(task.vehicle).discard(task.id)  # it may be pre-emptive now
        self._settle(task, now=now)

    def assign(self, task: Task, vehicle: int, *, choice: str, now: float) -> None:
        """Give a waiting task to another vehicle, in whose queue it keeps its rank."""
        is_ready = task.id in self.queue(task.vehicle)
        self.queue(task.vehicle).discard(task.id)
        self._of_vehicle[task.vehicle] -= 1
        self._of_vehicle[vehicle] = self._of_vehicle.get(vehicle, 0) + 1
        self.woken |= {task.vehicle, vehicle}
        task = self._registry.assign(task.id, vehicle, choice=choice, now=now)
        if is_ready:
            self._line_up(task)

    # series

    def plan_runs(self, *, now: float) -> None:
        """Add the next run of each series whose run has ended since, or say that it ends.

        The engine calls it before it hands out the events of a turn, so that an end and the run
        after it are stored in one transaction. A next run counts towards no limit: its series had
        one before.
        """
        for task_id in tuple(self._registry.unplanned):
            task = self._registry.get(task_id)
            if task is not None and not self._is_continued(task, now=now):
                return  # no id is granted: later
            del self._registry.unplanned[task_id]

    def _is_continued(self, task: Task, *, now: float) -> bool:
        """Add the run after a task, or say why its series ends; return False without a task id."""
        why_not = why_series_ends(task)
        run = None if why_not else next_run(task.terms, now=now, wall_offset=self.times.wall_offset)
        if run is None:
            why_not = why_not or "it has no further time"
            self._note(task, f"will not repeat task {task.id}: {why_not}", now=now)
            return True
        terms = replace(run.terms, after=0, is_staged=False, place=None)
        draft = Draft(
            task.vehicle, task.command, task.goal, task.submitter, terms, choice=task.choice
        )
        try:
            added = self._add(draft, now=now)
        except Rejection:
            return False
        if run.left_out:
            words = f"left out {left_out_words(run.left_out, terms.repeat)}"
            words += f" while task {task.id} waited or ran; task {added.id} is next"
            self._note(task, words, now=now)
        return True

    def _moved_on(self, task: Task, *, now: float) -> Task:
        """Return a waiting run; if the one after it is due, too, it starts later.

        So it went while the server was off, or the clock was set: a run starts late only as long as
        no other is due.
        """
        if not task.terms.repeat or task.state is S.BLOCKED or self.times.start(task.terms) > now:
            return task
        run = next_run(task.terms, now=now, wall_offset=self.times.wall_offset)
        if run is None or not run.left_out:
            return task
        words = (
            f"left out {left_out_words(1 + run.left_out, run.terms.repeat)} that passed meanwhile"
        )
        task = self._registry.modify(task.id, run.terms, actor=SERVER, now=now)
        at = utc_text(self.times.start(task.terms) + self.times.wall_offset)
        self._note(task, f"{words}; task {task.id} starts {at}", now=now)
        return task

    def _brought_forward(self, task: Task, *, now: float) -> Task:
        """Return a waiting run; if the clock was set back far, its times count from now."""
        terms = task.terms
        if task.is_made and terms.repeat and task.state is S.SCHEDULED:
            terms = brought_forward(terms, utc=now + self.times.wall_offset)
        if terms is task.terms:
            return task
        task = self._registry.modify(task.id, terms, actor=SERVER, now=now)
        self.times.note(task)
        return task

    def _note(self, task: Task, words: str, *, now: float) -> None:
        self._registry.record(VehicleNoted(task.vehicle, words, now))

    # removal

    def leave(self, task: Task) -> None:
        """Remove a task that starts or ends."""
        del self._waiters[task.id]
        self.times.forget((task.id,))
        self.queue(task.vehicle).discard(task.id)
        self._of_vehicle[task.vehicle] -= 1
        self._leave_owner(task.submitter.owner)
        self._part(task.id, task.terms.after)
        self.woken.add(task.vehicle)

    def forget(self, vehicle: int) -> None:
        """Forget the waiting tasks of a vehicle, without ending them; call ``forgotten`` later."""
        gone = [each for each in self._waiters if self._registry[each].vehicle == vehicle]
        for task_id in gone:
            del self._waiters[task_id]
            task = self._registry[task_id]
            self._leave_owner(task.submitter.owner)
            self._part(task_id, task.terms.after)
        self.times.forget(gone)
        self._queues.pop(vehicle, None)
        self._of_vehicle.pop(vehicle, None)
        self.woken.discard(vehicle)

    def forgotten(self, *, now: float) -> None:
        """Take that the registry has forgotten the tasks of a vehicle."""
        self._look_again(now=now)

    def _leave_owner(self, owner: str) -> None:
        left = self._of_owner[owner] - 1
        if left:
            self._of_owner[owner] = left
        else:
            del self._of_owner[owner]

    def end(
        self, task: Task, state: TaskState, reason: TaskReason, *, actor: str, now: float
    ) -> None:
        """End a waiting task, and fail its dependents."""
        self.leave(task)
        self._registry.change(task.id, state, reason=reason, actor=actor, now=now)
        self.ended(task.id, now=now)

    def withdraw(self, task: Task, *, now: float) -> None:
        """Withdraw a submission that did not become durable, and fail its dependents."""
        self.leave(task)
        self._registry.withdraw(task.id, now=now)
        self._part_all(task.id, completed=False, now=now)

    def clear(self, vehicle: int, reason: TaskReason, *, actor: str, now: float) -> None:
        """Cancel all waiting tasks of a vehicle."""
        cleared = [self._registry[task_id] for task_id in self.of(vehicle)]
        for task in cleared:  # cancel all first, so that no dependent among them fails
            self.leave(task)
            self._registry.change(task.id, S.CANCELLED, reason=reason, actor=actor, now=now)
        for task in cleared:
            self.ended(task.id, now=now)

    def ended(self, task_id: TaskId, *, now: float) -> None:
        """Settle the dependents of a task that completed, or fail those of a task that did not."""
        if ended := self._registry.get(task_id):
            self._part_all(task_id, completed=ended.state is S.COMPLETED, now=now)

    def _part_all(self, task_id: TaskId, *, completed: bool, now: float) -> None:
        """Settle the dependents of a task that is over, or fail them and their dependents."""
        over = [task_id]
        while over:
            for dependent in self._dependencies.take(over.pop()):
                if completed:
                    self._waiters[dependent].is_met = True
                    self._settle(self._registry[dependent], now=now)
                else:
                    self._fail(dependent, now=now)
                    over.append(dependent)

    # tasks of vehicles that other gateways have

    @property
    def expected(self) -> set[int]:
        """The tasks that ours run after and that are not ours: the fleet's store knows them."""
        return self._dependencies.expected

    def is_in_question(self, task_id: int) -> bool:
        """Return whether only the fleet's store can say whether a task exists."""
        return self._dependencies.is_in_question(task_id)

    def is_expecting(self, task: Task) -> bool:
        """Return whether a waiting task runs after one that is not ours."""
        waiter = self._waiters.get(task.id)
        is_met = waiter is None or waiter.is_met
        return not is_met and task.terms.after in self._dependencies.expected

    @contextmanager
    def told(self, states: Mapping[int, TaskState | None], *, now: float) -> Iterator[None]:
        """Take how tasks stand by the fleet's store; in the block submissions may name them.

        None: there is no such task. If ours run after it, it was withdrawn: they fail.
        """
        for task_id in sorted(self._dependencies.expected & states.keys()):
            state = states[task_id]
            if state is None or state in TERMINAL:
                self._part_all(TaskId(task_id), completed=state is S.COMPLETED, now=now)
        self._dependencies.told = states
        yield
        self._dependencies.told = {}

    def _look_again(self, *, now: float) -> None:
        for task_id in self._dependencies.look_again():  # it ended while another gateway had it
            self.ended(task_id, now=now)

    def _fail(self, task_id: TaskId, *, now: float) -> None:
        self.leave(self._registry[task_id])
        self._registry.change(task_id, S.FAILED, reason=R.DEPENDENCY_FAILED, actor=SERVER, now=now)

    def _waiting(self, task_id: TaskId) -> Task | None:
        return self._registry[task_id] if task_id in self._waiters else None

    def _part(self, task_id: TaskId, after: int) -> None:
        """Remove a dependency; the task that was waited for may lose an inherited rank."""
        if self._dependencies.forget(task_id, after):
            self._lift(TaskId(after))

    # order

    def _rerank(self, task: Task) -> None:
        waiter = self._waiters[task.id]
        waiter.own = _own_rank(self._settings, task, waiter.came_at)
        self._lift(task.id)

    def _most_urgent(self, task_id: TaskId, own: Rank) -> Rank:
        """Return a task's own rank, or that of its most urgent dependent if that is more urgent."""
        dependents = map(self._waiters.get, self._dependencies.of(task_id))
        return min([own, *(waiter.rank for waiter in dependents if waiter is not None)])

    def _lift(self, task_id: TaskId) -> None:
        """Update the rank of a task and, through it, of the tasks that it waits for."""
        seen = task_id
        while True:
            waiter = self._waiters.get(seen)
            if waiter is None:
                return
            rank = self._most_urgent(seen, waiter.own)
            if rank == waiter.rank and seen != task_id:
                return
            waiter.rank = rank
            task = self._registry[seen]
            if seen in self.queue(task.vehicle):
                self._line_up(task)
            if not task.terms.after:
                return
            seen = TaskId(task.terms.after)


def _own_rank(settings: Settings, task: Task, came_at: float) -> Rank:
    """Return a task's own rank, if it has competed with others since ``came_at``."""
    place = task.terms.place or QueuePlace(task.terms.priority, came_at, task.id)
    aging = settings.queueing.aging
    return rank_of(place.priority, came_at=place.at, task_id=place.task_id, aging=aging)
