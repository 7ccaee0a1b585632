"""Every task that has not begun, of all vehicles: what it waits for, and until when.

Start times, deadlines and dependencies are no vehicle's own business: a task can wait for one of
another vehicle. What is ready is in its vehicle's queue. A task that others wait for is as urgent
as the most urgent of them, directly or through others again.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from mav_tasks.errors import Rejection
from mav_tasks.settings import Settings
from mav_tasks.tasks.dependencies import Dependencies
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import WAITING, TaskReason, TaskState
from mav_tasks.tasks.queue import Entry, Rank, TaskQueue, full, rank_of
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Draft, Submitter, Task, TaskId, Terms
from mav_tasks.tasks.times import Times

R, S = TaskReason, TaskState


@dataclass(slots=True)
class _Waiter:
    """What is known of one waiting task beyond the registry."""

    came_at: float  # when it began to compete with others: submitted, or start time reached
    own: Rank
    rank: Rank  # its own, or that of one that waits for it


class PendingTasks:
    """Tasks in SCHEDULED, BLOCKED and QUEUED, by what will let them go on."""

    def __init__(self, registry: TaskRegistry, settings: Settings) -> None:
        self._registry = registry
        self._settings = settings
        self._waiters: dict[TaskId, _Waiter] = {}
        self._queues: dict[int, TaskQueue] = defaultdict(TaskQueue)
        self._of_vehicle: dict[int, int] = {}  # how many wait
        self._of_owner: dict[str, int] = {}
        self._dependencies = Dependencies(registry)
        #: when each may begin, and until when
        self.times = Times()
        #: the vehicles whose queues have got a task since they were taken
        self.woken: set[int] = set()

    def __repr__(self) -> str:
        return f"PendingTasks({len(self._waiters)} tasks)"

    def apply(self, settings: Settings) -> None:
        """Take new settings; the order of what waits already is kept."""
        self._settings = settings

    def queue(self, vehicle: int) -> TaskQueue:
        """Return the queue of a vehicle's ready tasks."""
        return self._queues[vehicle]

    def count(self, vehicle: int) -> int:
        """Return how many tasks of a vehicle wait, ready or not."""
        return self._of_vehicle.get(vehicle, 0)

    def count_of(self, submitter: Submitter) -> int:
        """Return how many tasks of a submitter wait, of all who are the same owner."""
        return self._of_owner.get(submitter.owner, 0)

    def of(self, vehicle: int) -> list[TaskId]:
        """Return all waiting tasks of a vehicle: first those that are ready, in order."""
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
        """Return a task's rank among those that are ready; of an active one, as if it were."""
        waiter = self._waiters.get(task.id)
        if waiter is not None:
            return waiter.rank
        return self._most_urgent(task.id, _own_rank(self._settings, task, task.submitted_at))

    def take_woken(self) -> set[int]:
        """Return the vehicles whose queues have got a task since the last call."""
        woken, self.woken = self.woken, set()
        return woken

    # coming

    def submit(self, draft: Draft, *, now: float) -> Task:
        """Take a new task in; Rejection when there is no room, or nothing to run after."""
        queueing = self._settings.queueing
        if self._of_vehicle.get(draft.vehicle, 0) >= queueing.capacity:
            raise full(queueing.capacity)
        owner = draft.submitter.owner
        if self._of_owner.get(owner, 0) >= queueing.quota:
            raise Rejection(R.QUOTA, f"quota: {queueing.quota} tasks of this client wait")
        if draft.terms.after:
            self._dependencies.check(draft.terms.after)
        state = self._state_by(draft.terms, now=now)
        task = self._registry.submit(draft, state=state, now=now)
        self._enter(task, owner, now=now)
        if state is S.QUEUED:  # nobody is woken: it is not durable yet
            self._line_up(task)
        return task

    def restore(self, tasks: Iterable[Task], *, now: float) -> None:
        """Take in the waiting ones of an earlier run's tasks, as they were."""
        waiting = [task for task in tasks if task.state in WAITING]
        for task in waiting:
            due = self.times.start(task.terms)
            came_at = max(task.submitted_at, due) if due <= now else task.submitted_at
            self._enter(task, task.submitter.owner, now=came_at)
            if task.id in self._dependencies:  # after a modification, in any order
                self._lift(task.id)
        ready: dict[int, list[Entry]] = {}
        others: list[Task] = []
        for task in waiting:
            if task.state is S.QUEUED and self._state_by(task.terms, now=now) is S.QUEUED:
                ready.setdefault(task.vehicle, []).append(self._entry(task))
            else:
                others.append(task)
        for vehicle, entries in ready.items():
            self.queue(vehicle).put_all(entries)
        for task in others:
            if task.id not in self._waiters or task.id in self.queue(task.vehicle):
                continue
            if self._dependencies.have_failed(task):  # the end of it was kept, what follows was not
                self._fail(task.id, now=now)
                self.ended(task.id, now=now)
            else:
                self._settle(task, now=now)

    def _enter(self, task: Task, owner: str, *, now: float) -> None:
        own = _own_rank(self._settings, task, now)
        self._waiters[task.id] = _Waiter(now, own, own)
        self._of_vehicle[task.vehicle] = self._of_vehicle.get(task.vehicle, 0) + 1
        self._of_owner[owner] = self._of_owner.get(owner, 0) + 1
        terms = task.terms
        self.times.note(task)
        if terms.after:
            self._dependencies.add(task.id, terms.after)
            self._lift(task.id)

    # going on

    def _settle(self, task: Task, *, now: float) -> Task:
        """Put a waiting task into the state that its terms ask for now."""
        wanted = self._state_by(task.terms, now=now)
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

    def _state_by(self, terms: Terms, *, now: float) -> TaskState:
        has_start = terms.start_at is not None or terms.start_utc is not None
        if has_start and self.times.start(terms) > now:
            return S.SCHEDULED
        if terms.is_staged or (terms.after and self._dependencies.is_waited_for(terms.after)):
            return S.BLOCKED
        return S.QUEUED

    def handle_deadline(self, *, now: float) -> None:
        """Let go on whose time has come, and end whose time is over."""
        for at, task_id in self.times.take_over(now=now):
            task = self._waiting(task_id)
            if task is not None and task.terms.deadline == at:  # not modified since
                self.end(task, S.EXPIRED, R.DEADLINE, actor=SERVER, now=now)
        for _, task_id in self.times.take_starts(now=now):
            task = self._waiting(task_id)
            if task is not None:
                self._settle(task, now=now)

    def set_wall_offset(self, offset: float, *, now: float) -> None:
        """UTC = monotonic time + offset from now on: moves what starts at a UTC time."""
        waiting = [self._registry[task_id] for task_id in self._waiters]
        self.times.set_wall_offset(offset, waiting)
        for task in waiting:
            if task.terms.start_utc is not None:
                self._settle(task, now=now)

    def modify(self, task: Task, terms: Terms, *, actor: str, now: float) -> None:
        """Change the terms of a waiting task; Rejection when it would wait for itself."""
        if terms.after and terms.after != task.terms.after:
            self._dependencies.check(terms.after)
            self._dependencies.check_cycle(task, terms.after)
        before = task.terms.after
        if task.terms.is_staged and not terms.is_staged:
            self._waiters[task.id].came_at = now  # it has not waited for the others until now
        task = self._registry.modify(task.id, terms, actor=actor, now=now)
        self.times.note(task)
        if before != terms.after:
            self._part(task.id, before)
            if terms.after:
                self._dependencies.add(task.id, terms.after)
        self._rerank(task)
        self.queue(task.vehicle).discard(task.id)  # it may be pre-emptive now
        self._settle(task, now=now)

    # leaving

    def leave(self, task: Task) -> None:
        """Let a task go: it begins, or is over."""
        del self._waiters[task.id]
        self.queue(task.vehicle).discard(task.id)
        self._of_vehicle[task.vehicle] -= 1
        owner = task.submitter.owner
        left = self._of_owner[owner] - 1
        if left:
            self._of_owner[owner] = left
        else:
            del self._of_owner[owner]
        self._part(task.id, task.terms.after)
        self.woken.add(task.vehicle)

    def end(
        self, task: Task, state: TaskState, reason: TaskReason, *, actor: str, now: float
    ) -> None:
        """End a waiting task, and what waits for it."""
        self.leave(task)
        self._registry.change(task.id, state, reason=reason, actor=actor, now=now)
        self.ended(task.id, now=now)

    def withdraw(self, task: Task, *, now: float) -> None:
        """Take back a submission that did not become durable, and what waits for it."""
        self.leave(task)
        self._registry.withdraw(task.id, now=now)
        for dependent in self._dependencies.take(task.id):
            self._fail(dependent, now=now)
            self.ended(dependent, now=now)

    def clear(self, vehicle: int, reason: TaskReason, *, actor: str, now: float) -> None:
        """Cancel all that wait for a vehicle."""
        cleared = [self._registry[task_id] for task_id in self.of(vehicle)]
        for task in cleared:  # first all of them: a dependent is cleared, too, and not failed
            self.leave(task)
            self._registry.change(task.id, S.CANCELLED, reason=reason, actor=actor, now=now)
        for task in cleared:
            self.ended(task.id, now=now)

    def ended(self, task_id: TaskId, *, now: float) -> None:
        """A task is over: let go on, or fail, what waits for it."""
        over = [task_id]
        while over:
            ended = self._registry.get(over.pop())
            if ended is None:
                continue
            for dependent in self._dependencies.take(ended.id):
                task = self._waiting(dependent)
                if task is None:
                    continue
                if ended.state is S.COMPLETED:
                    self._settle(task, now=now)
                else:
                    self._fail(dependent, now=now)
                    over.append(dependent)

    def _fail(self, task_id: TaskId, *, now: float) -> None:
        self.leave(self._registry[task_id])
        self._registry.change(task_id, S.FAILED, reason=R.DEPENDENCY_FAILED, actor=SERVER, now=now)

    def _waiting(self, task_id: TaskId) -> Task | None:
        return self._registry[task_id] if task_id in self._waiters else None

    def _part(self, task_id: TaskId, after: int) -> None:
        """A task runs after another one no more, which may be less urgent by that."""
        if self._dependencies.forget(task_id, after):
            self._lift(TaskId(after))

    # order

    def _rerank(self, task: Task) -> None:
        waiter = self._waiters[task.id]
        waiter.own = _own_rank(self._settings, task, waiter.came_at)
        self._lift(task.id)

    def _most_urgent(self, task_id: TaskId, own: Rank) -> Rank:
        """Return a task's own rank, or that of one that waits for it."""
        dependents = map(self._waiters.get, self._dependencies.of(task_id))
        return min([own, *(waiter.rank for waiter in dependents if waiter is not None)])

    def _lift(self, task_id: TaskId) -> None:
        """Return a task, and through it those that it waits for, the rank of who waits for it."""
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
    aging = settings.queueing.aging
    return rank_of(task.terms.priority, came_at=came_at, task_id=task.id, aging=aging)
