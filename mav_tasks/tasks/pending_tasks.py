"""The tasks of all vehicles that have not started: start times, deadlines, dependencies, queues.

One object holds them all, because a task can depend on a task of another vehicle. A ready task is
in its vehicle's queue. A task inherits the rank of the most urgent task that depends on it,
directly or through others.

In a fleet a task may run after one of a vehicle that another gateway has. The registry lacks that
one; the fleet's store says how it stands, and ``expected`` are the tasks that it is asked about. A
task that the registry lacks counts as not over until the store says that it is: a server that does
not know how a task stands must not start what waits for that task. What the store says never turns
back: a task is there, and later it has ended.

Dependencies have no circle. A new task may name only one that exists, so none waits for it yet. A
waiting task may be changed to run after another one only if all that this one waits for is known
here: the gateways have nothing in common that could find a circle over several of them.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Settings
from mav_tasks.tasks.cron import utc_text
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.queue import Rank, TaskQueue, rank_of
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.repetition import (
    CORRECTION,
    brought_forward,
    left_out_words,
    next_run,
    why_series_ends,
)
from mav_tasks.tasks.task import Draft, Submitter, Task, TaskId, Terms
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
        self._of_owner = Counter[str]()  # how many wait
        #: for each task, those that run after it, in the order in which they were added
        self._dependents: dict[int, dict[TaskId, None]] = {}
        #: start times and deadlines
        self.times = Times()
        #: the vehicles whose tasks became ready or left; the reader clears it
        self.woken: set[int] = set()
        #: whether tasks that the registry lacks may be another gateway's
        self.is_shared = False
        #: the tasks with dependents that the registry lacks: the fleet's store knows them
        self.expected: set[int] = set()
        #: what the fleet's store says, while that is handled; None: there is no such task
        self._told: Mapping[int, TaskState | None] = {}

    def __repr__(self) -> str:
        return f"PendingTasks({len(self._waiters)} tasks)"

    def apply(self, settings: Settings) -> None:
        """Apply new settings; tasks that already wait keep their order."""
        self._settings = settings

    def queue(self, vehicle: int) -> TaskQueue:
        """Return the queue of a vehicle's ready tasks."""
        return self._queues[vehicle]

    def count(self, vehicle: int) -> int:
        """Return how many tasks of a vehicle wait, ready or not."""
        return sum(self._registry.counts[vehicle][: S.STARTING])

    def count_of(self, submitter: Submitter) -> int:
        """Return how many tasks of a submitter's owner wait."""
        return self._of_owner[submitter.owner]

    def of(self, vehicle: int) -> list[TaskId]:
        """Return all waiting tasks of a vehicle: the ready ones in order, then the others."""
        queue = self._queues[vehicle]
        if len(queue) == self.count(vehicle):
            return queue.in_order()
        others = [
            (self.times.start(self._registry[each].terms), waiter.rank, each)
            for each, waiter in self._waiters.items()
            if self._registry[each].vehicle == vehicle and each not in queue
        ]
        return queue.in_order() + [task_id for _, _, task_id in sorted(others)]

    def rank(self, task: Task) -> Rank:
        """Return a task's rank among the ready ones; for an active task, the rank it would have."""
        if waiter := self._waiters.get(task.id):
            return waiter.rank
        came_at, aging = task.submitted_at, self._settings.queueing.aging
        own = rank_of(task.terms, came_at=came_at, task_id=task.id, aging=aging)
        return self._most_urgent(task.id, own)

    # arrival

    def submit(self, draft: Draft, *, now: float) -> Task:
        """Add a new task. Raise Rejection at a limit, or if its dependency cannot complete."""
        queueing = self._settings.queueing
        if sum(self._registry.counts[draft.vehicle][: S.STARTING]) >= queueing.capacity:
            raise Rejection(R.QUEUE_FULL, f"queue full: {queueing.capacity} tasks wait")
        quota = queueing.quota
        if len(self._waiters) >= quota and self.count_of(draft.submitter) >= quota:
            raise Rejection(R.QUOTA, f"quota: this client has {quota} waiting tasks")
        if draft.terms.after:
            self._check(draft.terms.after)
        return self._add(draft, now=now)

    def _add(self, draft: Draft, *, now: float) -> Task:
        after = draft.terms.after
        is_met = bool(after) and self._stands(after) is S.COMPLETED
        state = self._state_by(draft.terms, is_met=is_met, now=now)
        task = self._registry.submit(draft, state=state, now=now)
        waiter = self._enter(task, now=now)
        if state is S.QUEUED:  # wakes nobody: it is not durable yet
            self._queues[task.vehicle].put(task.id, waiter.rank, task.terms)
        return task

    def restore(self, tasks: Iterable[Task], *, now: float) -> None:
        """Add those tasks of an earlier run that were waiting."""
        waiting = [self._moved_on(task, now=now) for task in tasks if task.state in WAITING]
        for task in waiting:
            due = self.times.start(task.terms)
            came_at = max(task.submitted_at, due) if due <= now else task.submitted_at
            self._enter(task, now=came_at)
            if task.id in self._dependents:  # a modification may have put dependents first
                self._lift(task.id)
        ready: dict[int, list[tuple[TaskId, Rank, Terms]]] = {}
        for task in waiting:
            if task.state is S.QUEUED and self._wanted(task, now=now) is S.QUEUED:
                entry = task.id, self._waiters[task.id].rank, task.terms
                ready.setdefault(task.vehicle, []).append(entry)
        for vehicle, entries in ready.items():
            self._queues[vehicle].put_all(entries)
        for task in waiting:
            if task.id not in self._waiters or task.id in self._queues[task.vehicle]:
                continue
            if self._has_failed(task.terms.after):  # that was stored, its consequence was not
                self.end(task, S.FAILED, R.DEPENDENCY_FAILED, now=now)
            else:
                self._settle(task, now=now)
        self._look_again(now=now)

    def _enter(self, task: Task, *, now: float) -> _Waiter:
        aging = self._settings.queueing.aging
        own = rank_of(task.terms, came_at=now, task_id=task.id, aging=aging)
        waiter = self._waiters[task.id] = _Waiter(now, own, own)
        self._of_owner[task.submitter.owner] += 1
        self.times.note(task)
        if task.terms.after:
            self._depend(task)
            self._lift(task.id)
        return waiter

    # changes of state

    def _settle(self, task: Task, *, now: float) -> Task:
        """Move a waiting task to the state and queue that its terms require now."""
        wanted = self._wanted(task, now=now)
        if task.state is S.SCHEDULED and wanted is not S.SCHEDULED and task.terms.repeat:
            task = self._moved_on(task, now=now)  # the clock may have passed more than one run
            wanted = self._wanted(task, now=now)
            self.times.note(task)
        if task.state is S.SCHEDULED and wanted is not S.SCHEDULED:
            came_at = self._waiters[task.id].came_at
            self._rerank(task, came_at=max(came_at, self.times.start(task.terms)))
        if task.state is not wanted:
            task = self._registry.change(task.id, wanted, now=now)
        if wanted is S.QUEUED:
            self._put(task)
            self.woken.add(task.vehicle)
        else:
            self._queues[task.vehicle].discard(task.id)
        return task

    def _put(self, task: Task) -> None:
        self._queues[task.vehicle].put(task.id, self._waiters[task.id].rank, task.terms)

    def _wanted(self, task: Task, *, now: float) -> TaskState:
        return self._state_by(task.terms, is_met=self._waiters[task.id].is_met, now=now)

    def _state_by(self, terms: Terms, *, is_met: bool, now: float) -> TaskState:
        if self.times.start(terms) > now:
            return S.SCHEDULED
        if terms.is_staged:
            return S.BLOCKED
        if terms.after and not is_met:
            state = self._stands(terms.after)
            is_waited_for = self.is_shared if state is None else state not in TERMINAL
            return S.BLOCKED if is_waited_for else S.QUEUED
        return S.QUEUED

    def handle_deadline(self, *, now: float) -> None:
        """Expire tasks whose deadline has passed, and settle those whose start time has come."""
        due = [self._registry[task_id] for task_id in self.times.take(now=now)]
        late = [task for task in due if self.times.is_too_late(task, now=now)]
        for task in late:
            if task.id in self._waiters:
                self.end(task, S.EXPIRED, R.DEADLINE, now=now)
        for task in due:
            if task.id in self._waiters:
                self.times.started(task)
                self._settle(self._registry[task.id], now=now)

    def set_wall_offset(self, offset: float, *, now: float) -> None:
        """Set UTC minus monotonic time, s; this moves the tasks that start at a UTC time."""
        waiting = [self._registry[task_id] for task_id in self._waiters]
        is_corrected = self.times.wall_offset - offset > CORRECTION
        self.times.wall_offset = offset
        for task in waiting:
            self.times.note(task)
        if is_corrected:
            waiting = [self._brought_forward(task, now=now) for task in waiting]
        for task in waiting:
            if task.terms.start_utc is not None:
                self._settle(task, now=now)

    def modify(self, task: Task, terms: Terms, *, actor: str, now: float) -> None:
        """Change the terms of a waiting task. Raise Rejection if its dependency cannot complete."""
        before, after = task.terms.after, terms.after
        if after and after != before:
            self._check_change(task, after)
        came_at = self._waiters[task.id].came_at
        if task.terms.is_staged and not terms.is_staged:
            came_at = now  # it has not competed with others until now
        task = self._registry.modify(task.id, terms, actor=actor, now=now)
        self.times.note(task)
        if before != after:
            self._part(task.id, before)
            self._depend(task)
        self._rerank(task, came_at=came_at)
        self._queues[task.vehicle].discard(task.id)  # it may be pre-emptive now
        self._settle(task, now=now)

    def assign(self, task: Task, vehicle: int, *, choice: str, now: float) -> None:
        """Move a waiting task to another vehicle, in whose queue it keeps its rank."""
        is_ready = task.id in self._queues[task.vehicle]
        self._queues[task.vehicle].discard(task.id)
        self.woken |= {task.vehicle, vehicle}
        task = self._registry.assign(task.id, vehicle, choice=choice, now=now)
        if is_ready:
            self._put(task)

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
            self._registry.note(task.vehicle, f"will not repeat task {task.id}: {why_not}", now=now)
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
            self._registry.note(task.vehicle, words, now=now)
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
        task = self._registry.modify(task.id, run.terms, now=now)
        at = utc_text(self.times.start(task.terms) + self.times.wall_offset)
        words = f"left out {left_out_words(1 + run.left_out, run.terms.repeat)}"
        words += f" that passed meanwhile; task {task.id} starts {at}"
        self._registry.note(task.vehicle, words, now=now)
        return task

    def _brought_forward(self, task: Task, *, now: float) -> Task:
        """Return a waiting run; if the clock was set back far, its times count from now."""
        terms = task.terms
        if task.is_made and terms.repeat and task.state is S.SCHEDULED:
            terms = brought_forward(terms, utc=now + self.times.wall_offset)
        if terms is task.terms:
            return task
        task = self._registry.modify(task.id, terms, now=now)
        self.times.note(task)
        return task

    # removal

    def leave(self, task: Task) -> None:
        """Remove a task that starts or ends."""
        del self._waiters[task.id]
        self.times.forget(task.id)
        self._queues[task.vehicle].discard(task.id)
        owner = task.submitter.owner
        self._of_owner[owner] -= 1
        if not self._of_owner[owner]:
            del self._of_owner[owner]
        self._part(task.id, task.terms.after)
        self.woken.add(task.vehicle)

    def forget(self, vehicle: int, *, now: float) -> set[TaskId]:
        """Forget all tasks of a vehicle, without ending them; return their ids."""
        for task_id in [e for e in self._waiters if self._registry[e].vehicle == vehicle]:
            self.leave(self._registry[task_id])
        self._queues.pop(vehicle, None)
        self.woken.discard(vehicle)
        gone = self._registry.forget(vehicle)
        self._look_again(now=now)
        return gone

    def end(
        self, task: Task, state: TaskState, reason: TaskReason, *, actor: str = SERVER, now: float
    ) -> None:
        """End a waiting task, and fail its dependents."""
        self._end(task, state, reason, actor=actor, now=now)
        self.ended(task.id, now=now)

    def _end(
        self, task: Task, state: TaskState, reason: TaskReason, *, actor: str = SERVER, now: float
    ) -> None:
        self.leave(task)
        self._registry.change(task.id, state, reason=reason, actor=actor, now=now)

    def withdraw(self, task: Task, *, now: float) -> None:
        """Withdraw a submission that did not become durable, and fail its dependents."""
        self.leave(task)
        self._registry.withdraw(task.id, now=now)
        self._part_all(task.id, completed=False, now=now)

    def clear(self, vehicle: int, reason: TaskReason, *, actor: str, now: float) -> None:
        """Cancel all waiting tasks of a vehicle."""
        cleared = self.of(vehicle)
        for task_id in cleared:  # cancel all first, so that no dependent among them fails
            self._end(self._registry[task_id], S.CANCELLED, reason, actor=actor, now=now)
        for task_id in cleared:
            self.ended(task_id, now=now)

    def ended(self, task_id: TaskId, *, now: float) -> None:
        """Settle the dependents of a task that completed, or fail those of a task that did not."""
        if ended := self._registry.get(task_id):
            self._part_all(task_id, completed=ended.state is S.COMPLETED, now=now)

    # dependencies

    def _stands(self, after: int) -> TaskState | None:
        """Return the state of a task as far as it is known, here or by the fleet's store."""
        task = self._registry.get(after)
        return self._told.get(after) if task is None else task.state

    def _has_failed(self, after: int) -> bool:
        """Return whether a task is known to have ended without being completed."""
        state = self._stands(after)
        return state is not S.COMPLETED and state in TERMINAL

    def is_in_question(self, after: int) -> bool:
        """Return whether only the fleet's store can say whether a task exists."""
        is_known = after in self.expected or after in self._told
        return self.is_shared and not is_known and self._registry.get(after) is None

    def is_expecting(self, task: Task) -> bool:
        """Return whether a waiting task runs after one that is not ours."""
        waiter = self._waiters.get(task.id)
        return waiter is not None and not waiter.is_met and task.terms.after in self.expected

    def _check(self, after: int) -> None:
        """Raise Rejection if a task could never run after this one."""
        state = self._stands(after)
        if state is None and after not in self.expected:
            raise Rejection(R.UNKNOWN_DEPENDENCY, f"run after {after}: no such task")
        if state is not None and self._has_failed(after):
            words = f"run after {after}: that task has ended ({state.name.lower()})"
            raise Rejection(R.DEPENDENCY_FAILED, words)

    def _check_change(self, task: Task, after: int) -> None:
        """Raise Rejection if a waiting task cannot be changed to run after this one.

        It would wait for itself, directly or through others, or nobody knows whether it would.
        """
        if self.is_shared and self._registry.get(after) is None:
            words = f"run after {after}: no rover of this gateway has that task:"
            words += " cancel this one, and submit it again to run after that"
            raise Rejection(R.UNKNOWN_DEPENDENCY, words)
        self._check(after)
        seen = after
        while seen:
            if seen == task.id:
                raise Rejection(R.CYCLE, f"run after {after}: the tasks would wait for each other")
            if seen in self.expected:
                words = f"run after {after}: that one waits for task {seen} of another gateway"
                raise Rejection(R.CYCLE, f"{words}; perhaps the tasks would wait for each other")
            ahead = self._registry.get(seen)
            seen = 0 if ahead is None or ahead.state not in WAITING else ahead.terms.after

    def _depend(self, task: Task) -> None:
        """Note what a waiting task runs after, unless that has completed.

        Only that lets a task become ready. By now the store may have deleted the one before it.
        """
        after, state = task.terms.after, self._stands(task.terms.after)
        was_met = self.is_shared and self._registry.get(after) is None and task.state is S.QUEUED
        is_met = bool(after) and (state is S.COMPLETED or was_met)
        self._waiters[task.id].is_met = is_met
        if after and not is_met:
            self._dependents.setdefault(after, {})[task.id] = None
            if self.is_shared and self._registry.get(after) is None:
                self.expected.add(after)

    def _part(self, task_id: TaskId, after: int) -> None:
        """Remove a dependency; the task that was waited for may lose an inherited rank."""
        dependents = self._dependents.get(after, {})
        if task_id in dependents:
            del dependents[task_id]
            if not dependents:
                del self._dependents[after]
                self.expected.discard(after)
            self._lift(TaskId(after))

    def _part_all(self, task_id: int, *, completed: bool, now: float) -> None:
        """Settle the dependents of a task that is over, or fail them and their dependents."""
        over = [task_id]
        while over:
            self.expected.discard(over[-1])
            for dependent in self._dependents.pop(over.pop(), ()):
                task = self._registry[dependent]
                if completed:
                    self._waiters[dependent].is_met = True
                    self._settle(task, now=now)
                else:
                    self._end(task, S.FAILED, R.DEPENDENCY_FAILED, now=now)
                    over.append(dependent)

    @contextmanager
    def told(self, states: Mapping[int, TaskState | None], *, now: float) -> Iterator[None]:
        """Take how tasks stand by the fleet's store; in the block submissions may name them.

        None: there is no such task. If ours run after it, it was withdrawn: they fail.
        """
        for task_id in sorted(self.expected & states.keys()):
            state = states[task_id]
            if state is None or state in TERMINAL:
                self._part_all(task_id, completed=state is S.COMPLETED, now=now)
        self._told = states
        yield
        self._told = {}

    def _look_again(self, *, now: float) -> None:
        """Take that the registry has other tasks now: some ended while another gateway had them."""
        before = self.expected
        if self.is_shared:
            lacks = (each for each in self._dependents if self._registry.get(each) is None)
            self.expected = set(lacks)
        for task_id in sorted(before):
            task = self._registry.get(task_id)
            if task is not None and task.state in TERMINAL:
                self.ended(task.id, now=now)

    # order

    def _rerank(self, task: Task, *, came_at: float) -> None:
        waiter, aging = self._waiters[task.id], self._settings.queueing.aging
        waiter.came_at = came_at
        waiter.own = rank_of(task.terms, came_at=came_at, task_id=task.id, aging=aging)
        self._lift(task.id)

    def _most_urgent(self, task_id: TaskId, own: Rank) -> Rank:
        """Return a task's own rank, or that of its most urgent dependent if that is more urgent."""
        dependents = map(self._waiters.get, self._dependents.get(task_id, ()))
        return min([own, *(waiter.rank for waiter in dependents if waiter is not None)])

    def _lift(self, task_id: TaskId) -> None:
        """Update the rank of a task and, through it, of the tasks that it waits for."""
        seen = task_id
        while waiter := self._waiters.get(seen):
            rank = self._most_urgent(seen, waiter.own)
            if rank == waiter.rank and seen != task_id:
                return
            waiter.rank = rank
            task = self._registry[seen]
            if seen in self._queues[task.vehicle]:
                self._put(task)
            seen = TaskId(task.terms.after)
