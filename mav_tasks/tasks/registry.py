"""Every task of the server, and the events that ``take_events`` has not returned yet.

All changes of tasks go through the registry, so that the journal and the tasks cannot disagree.
Events are numbered from 1. The store reports the number up to which they are durable.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Container, Sequence
from dataclasses import replace
from itertools import islice
from typing import cast

from mav_tasks.basics.errors import Rejection
from mav_tasks.tasks.events import (
    SERVER,
    ActTold,
    Event,
    StepReached,
    TaskAdvanced,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskProgressed,
    TaskSubmitted,
    TaskWithdrawn,
    VehicleNoted,
)
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.lifecycle import (
    TERMINAL,
    WAITING,
    TaskReason,
    TaskState,
    check_transition,
)
from mav_tasks.tasks.repetition import why_series_ends
from mav_tasks.tasks.task import Draft, Progress, Submitter, Task, TaskId, Terms, following
from mav_tasks.tasks.timing import Timing

STATES = len(TaskState)
KEPT_FINISHED = 10_000  # tasks; beyond this the registry forgets the oldest finished ones


class TaskIds:
    """Ids begin at 1 again after MAX_TASK_ID; the earlier tasks with these ids are long over."""

    def __init__(self, next_id: int = 1) -> None:
        #: the id that the next task gets if it is free
        self.next = next_id
        self._left = 0  # of the present range
        self._ranges: deque[tuple[int, int]] = deque()
        self._is_shared = False

    def __repr__(self) -> str:
        return f"TaskIds({self.next}, {self._ranges if self._is_shared else 'all'})"

    def share(self) -> None:
        """Use granted ids only: other gateways give ids, too."""
        self._is_shared = True

    def grant(self, first: int, count: int) -> None:
        """Add ``count`` ids from ``first`` on."""
        self._ranges.append((first, count))

    def take(self, used: Container[int]) -> TaskId:
        """Return the next id that is not in use; raise Rejection if none is granted."""
        while True:
            if self._is_shared:
                if not self._left:
                    if not self._ranges:
                        words = "the database has not granted a task id yet: not accepted"
                        raise Rejection(TaskReason.STORE_UNAVAILABLE, words)
                    self.next, self._left = self._ranges.popleft()
                self._left -= 1
            task_id = TaskId(self.next)
            self.next = following(task_id)
            if task_id not in used:
                return task_id


class TaskRegistry:
    """Tasks by id, and the numbered journal of their events."""

    def __init__(self, *, next_id: int = 1) -> None:
        #: the ids of new tasks
        self.ids = TaskIds(next_id)
        self._tasks: dict[TaskId, Task] = {}
        self._last_event: dict[TaskId, int] = {}
        self._finished: deque[TaskId] = deque()
        self._live: dict[tuple[Submitter, int, int], dict[TaskId, None]] = {}
        #: by series: its run that is not over
        self.runs: dict[int, TaskId] = {}
        #: runs that are over, and whose series has not been continued or ended yet
        self.unplanned: dict[TaskId, None] = {}
        #: how many tasks there are, by vehicle, then by TaskState; read-only
        self.counts: dict[int, list[int]] = defaultdict(lambda: [0] * STATES)
        #: return a task, or None if the id is unknown or forgotten
        self.get: Callable[[int], Task | None] = cast("dict[int, Task]", self._tasks).get
        self._last_of: dict[int, int] = {}  # the number of each vehicle's last event
        #: recorded, and not taken yet
        self.events: list[Event] = []
        self.recorded = 0  # number of the last event recorded
        self.durable = 0  # number of the last event known to be durable

    def __repr__(self) -> str:
        return (
            f"TaskRegistry({len(self._tasks)} tasks, event {self.recorded}, durable {self.durable})"
        )

    def __len__(self) -> int:
        return len(self._tasks)

    def __getitem__(self, task_id: TaskId) -> Task:
        return self._tasks[task_id]

    def all(self) -> tuple[Task, ...]:
        """Return every task that is kept, oldest first."""
        return tuple(self._tasks.values())

    def restore(self, tasks: Sequence[Task]) -> None:
        """Load the tasks of an earlier run, all of them durable."""
        self._tasks.update((task.id, task) for task in tasks)
        over = [task for task in tasks if task.state in TERMINAL]
        over.sort(key=lambda task: task.ended_at)
        self._finished.extend(task.id for task in over)
        newest: dict[int, Task] = {}  # by series
        for task in tasks:
            self.counts[task.vehicle][task.state] += 1
            if task.state not in TERMINAL:
                self._note_live(task)
            if task.terms.series:
                newest[task.terms.series] = task
        for task in newest.values():
            is_over = task.state in TERMINAL and task.terms.series not in self.runs
            if is_over and task.terms.repeat and not why_series_ends(task):
                self.unplanned[task.id] = None  # there was no id for the next run

    def submit(self, draft: Draft, *, now: float, state: TaskState = TaskState.QUEUED) -> Task:
        """Create a task from a draft, with the next free id; raise Rejection if there is none."""
        task_id = self.ids.take(self._tasks)
        task = Task(
            id=task_id,
            vehicle=draft.vehicle,
            command=draft.command,
            goal=draft.goal,
            submitter=draft.submitter,
            marks=draft.marks,
            submitted_at=now,
            terms=draft.terms,
            state=state,
            choice=draft.choice,
        )
        self._tasks[task.id] = task
        self.counts[task.vehicle][state] += 1
        self._note_live(task)
        self.record(TaskSubmitted(task, now))
        if task.choice and not task.is_made:
            self.record(TaskAssigned(task.id, task.vehicle, task.version, 0, task.choice, now))
        self._last_of[task.vehicle] = self.recorded
        self._last_event[task.id] = self.recorded
        return task

    def change(
        self,
        task_id: TaskId,
        new: TaskState,
        *,
        now: float,
        reason: TaskReason = TaskReason.NONE,
        actor: str = SERVER,
        progress: Progress | None = None,
        timing: Timing | None = None,
    ) -> Task:
        """Move a task to another state. Raise IllegalTransition if the lifecycle lacks the edge.

        ``progress`` and ``timing`` stay as they were if None.
        """
        old = self._tasks[task_id]
        check_transition(old.state, new)
        timing = timing or old.timing
        if timing is not None and new in TERMINAL:
            timing = replace(timing, spread=())
        task = replace(
            old,
            state=new,
            reason=reason,
            version=old.version + 1,
            progress=old.progress if progress is None else progress,
            timing=timing,
            changed_at=now,
        )
        self._tasks[task_id] = task
        counts = self.counts[task.vehicle]
        counts[old.state] -= 1
        counts[new] += 1
        self.record(
            TaskChanged(
                task_id,
                task.vehicle,
                task.version,
                old.state,
                new,
                reason,
                actor,
                now,
                task.progress,
                task.timing,
            )
        )
        self._last_event[task_id] = self.recorded
        if new in TERMINAL:
            self._forget_live(task)
            if task.terms.repeat:
                self.unplanned[task_id] = None
            self._finish(task_id)
        return task

    def modify(self, task_id: TaskId, terms: Terms, *, actor: str = SERVER, now: float) -> Task:
        """Change the terms of a task that is not over, or no longer repeats."""
        old = self._tasks[task_id]
        task = self._tasks[task_id] = replace(old, terms=terms, version=old.version + 1)
        self._note_run(old, task)
        self.record(TaskModified(task_id, task.vehicle, task.version, terms, actor, now, old.terms))
        self._last_event[task_id] = self.recorded
        return task

    def assign(self, task_id: TaskId, vehicle: int, *, choice: str, now: float) -> Task:
        """Move a waiting task to another vehicle; ``choice`` says why."""
        old = self._tasks[task_id]
        assert old.state in WAITING, f"{old} has begun"
        self._forget_live(old)
        version = old.version + 1
        task = replace(old, vehicle=vehicle, choice=choice, version=version)
        self._tasks[task_id] = task
        self._note_live(task)
        self.counts[old.vehicle][old.state] -= 1
        self.counts[vehicle][task.state] += 1
        self.record(TaskAssigned(task_id, vehicle, version, old.vehicle, choice, now))
        self._last_of[old.vehicle] = self._last_event[task_id] = self.recorded
        return task

    def advance(self, task_id: TaskId, progress: Progress, *, now: float) -> None:
        """Record a task's progress, as when it begins its next leg."""
        old = self._tasks[task_id]
        task = replace(old, progress=progress, version=old.version + 1)
        self._tasks[task_id] = task
        item = _item_number(task, progress.step)
        self.record(TaskAdvanced(task_id, task.vehicle, task.version, progress, now, item))

    def hold_back(self, task_id: TaskId) -> None:
        """Let a task drive on only once all that is recorded so far is durable."""
        self._last_event[task_id] = self.recorded

    def reached(self, task_id: TaskId, step: int, *, performs: bool, now: float) -> None:
        """Record that a step of a plan is done; ``performs``: it is sent to the vehicle."""
        task = self._tasks[task_id]
        item = _item_number(task, step)
        self.record(StepReached(task_id, task.vehicle, step, performs, now, item))

    def will_act(self, task_id: TaskId, progress: Progress, *, now: float) -> None:
        """Record that an act is about to be told; it is when this is durable."""
        self.note_progress(task_id, progress)
        self.keep_progress(task_id, now=now)
        self.hold_back(task_id)

    def acts(self, task_id: TaskId, step: int, *, now: float) -> None:
        """Record that an act is told to the vehicle now."""
        task = self._tasks[task_id]
        self.record(ActTold(task_id, task.vehicle, step, now, _item_number(task, step)))

    def note_progress(self, task_id: TaskId, progress: Progress) -> None:
        """Set live progress, for status only: no event, no new version."""
        self._tasks[task_id] = replace(self._tasks[task_id], progress=progress)

    def keep_progress(self, task_id: TaskId, *, now: float) -> None:
        """Store the live progress, for the next run after a crash. No new version."""
        task = self._tasks[task_id]
        self.record(TaskProgressed(task_id, task.vehicle, task.version, task.progress, now))

    def withdraw(self, task_id: TaskId, *, now: float) -> None:
        """Withdraw a submission that did not become durable in time."""
        task = self._tasks.pop(task_id)
        self.counts[task.vehicle][task.state] -= 1
        self._forget_live(task)
        self._last_event.pop(task_id, None)
        self.record(TaskWithdrawn(task_id, task.vehicle, now))

    def latest(self, submitter: Submitter, command: int, *, vehicle: int) -> Task | None:
        """Return a client's latest unfinished task of a command, or None."""
        live = self._live.get((submitter, command, vehicle))
        return self._tasks[next(reversed(live))] if live else None

    def finished(self, vehicle: int, first: int, count: int) -> list[TaskId]:
        """Return a vehicle's finished tasks, newest first: ``count`` from offset ``first`` on."""
        over = (each for each in reversed(self._finished) if self._tasks[each].vehicle == vehicle)
        return list(islice(over, first, first + count))

    def repeat_no_more(self, task_id: TaskId, *, actor: str, now: float) -> None:
        """Let a task no longer repeat; its run may be over, with the next one not planned yet."""
        self.modify(task_id, replace(self._tasks[task_id].terms, repeat=""), actor=actor, now=now)
        self.unplanned.pop(task_id, None)

    def run_of(self, series: int) -> TaskId | None:
        """Return the run of a series that is not over, or the last one if another is to follow."""
        if run := self.runs.get(series):
            return run
        over = (self._tasks[each] for each in self.unplanned if each in self._tasks)
        return next((task.id for task in over if task.terms.series == series), None)

    def runs_of(self, vehicle: int) -> list[Task]:
        """Return a run of each of a vehicle's series: it is not over, or another is to follow."""
        over = [self._tasks[each] for each in self.unplanned if each in self._tasks]
        runs = [self._tasks[task_id] for task_id in self.runs.values()]
        runs += [task for task in over if not why_series_ends(task)]
        return [task for task in runs if task.vehicle == vehicle]

    def is_awaited_at(self, link: str, endpoint: str) -> bool:
        """Return whether a client's endpoint has an unfinished task."""
        return any((s.link, s.endpoint) == (link, endpoint) for s, _, _ in self._live)

    def record(self, event: Event) -> None:
        """Append an event to the journal."""
        self.recorded += 1
        if vehicle := getattr(event, "vehicle", 0):
            self._last_of[vehicle] = self.recorded
        self.events.append(event)

    def note(self, vehicle: int, words: str, *, now: float) -> None:
        """Record something about a vehicle that its operator should read."""
        self.record(VehicleNoted(vehicle, words, now))

    def is_durable(self, task_id: TaskId) -> bool:
        """Return whether the task's last submission, state change or modification is durable."""
        return self._last_event.get(task_id, 0) <= self.durable

    def last_event_of(self, vehicle: int) -> int:
        """Return the number of a vehicle's last event, 0 for none in this run."""
        return self._last_of.get(vehicle, 0)

    def forget(self, vehicle: int) -> set[TaskId]:
        """Forget a vehicle and its tasks, which are durable; return the ids of these."""
        gone = {task.id: task for task in self._tasks.values() if task.vehicle == vehicle}
        for task_id, task in gone.items():
            del self._tasks[task_id]
            self._last_event.pop(task_id, None)
            self.unplanned.pop(task_id, None)  # the next gateway goes on with its series
            if task.state not in TERMINAL:
                self._forget_live(task)
        self._finished = deque(each for each in self._finished if each not in gone)
        self.counts.pop(vehicle, None)
        self._last_of.pop(vehicle, None)
        return set(gone)

    def take_events(self) -> list[Event]:
        """Return the events since the last call, in order of their numbers."""
        events, self.events = self.events, []
        return events

    def _finish(self, task_id: TaskId) -> None:
        self._finished.append(task_id)
        if len(self._finished) > KEPT_FINISHED:
            oldest = self._finished.popleft()
            task = self._tasks.pop(oldest)
            self.counts[task.vehicle][task.state] -= 1
            self._last_event.pop(oldest, None)

    def _note_live(self, task: Task) -> None:
        self._live.setdefault((task.submitter, task.command, task.vehicle), {})[task.id] = None
        if task.terms.repeat:
            self.runs[task.terms.series] = task.id

    def _note_run(self, before: Task, task: Task) -> None:
        """Note that a task has begun, or ceased, to repeat."""
        if before.terms.repeat:
            self.runs.pop(before.terms.series, None)
        if task.terms.repeat:
            self.runs[task.terms.series] = task.id

    def _forget_live(self, task: Task) -> None:
        key = task.submitter, task.command, task.vehicle
        if task.terms.repeat:
            self.runs.pop(task.terms.series, None)
        live = self._live[key]
        del live[task.id]
        if not live:
            del self._live[key]


def _item_number(task: Task, step: int) -> int:
    """Return a step's item number in its file; 0: home, past the end, or no plan."""
    if not isinstance(task.goal, Plan) or not 0 <= step < len(task.goal.steps):
        return 0
    return task.goal.item_number(step)
