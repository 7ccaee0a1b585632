"""Tasks as clients and the disk know them: none is lost or duplicated, final states stay.

It follows the journals of all servers in turn, and the acks and TASK_STATUS of clients.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from mav_tasks.tasks.events import (
    Event,
    SubmissionRefused,
    TaskChanged,
    TaskSubmitted,
    TaskWithdrawn,
)
from mav_tasks.tasks.lifecycle import TERMINAL, TRANSITIONS, TaskReason, TaskState
from mav_tasks.tasks.task import Submitter, Task
from tests.kit.client import TaskStatus

#: submitter, vehicle, command and nonce: equal marks mean the same task
Mark = tuple[str, str, int, int, int]
COMMIT = 0.35  # s, least wait of a final status for the disk, less a few grains
NOT_STORED = 1.0  # s after which a submission that is not durable is refused


@dataclass
class Ledger:
    """Checks tasks over all servers of one life."""

    #: state by id, from the present server's journal
    states: dict[int, TaskState] = field(default_factory=dict)
    #: ids whose acceptance a client was told
    accepted: set[int] = field(default_factory=set)
    #: every id, with the mark of its submission
    given: dict[int, Mark] = field(default_factory=dict)
    #: the last state and version that a client was told
    told: dict[tuple[str, int], tuple[int, TaskState]] = field(default_factory=dict)
    withdrawn: set[int] = field(default_factory=set)
    #: ids of tasks that have started
    active: set[int] = field(default_factory=set)
    taken_back: int = 0  # final states that were told and lost with their server
    _of_mark: dict[Mark, int] = field(default_factory=dict)
    _ended_at: dict[int, float] = field(default_factory=dict)
    _asked: dict[int, tuple[str, float]] = field(default_factory=dict)  # submitter and time

    def follow(self, events: Iterable[Event]) -> Iterator[str]:
        """Take events of the present server; yield errors in them."""
        for event in events:
            match event:
                case TaskSubmitted(task=task):
                    yield from self._submit(task)
                case TaskChanged(task_id=task_id, old=old, new=new):
                    if new in TERMINAL:
                        self._ended_at[task_id] = event.at
                    yield from self._change(task_id, old, new)
                case TaskWithdrawn(task_id=task_id):
                    self.withdrawn.add(task_id)
                    self.states.pop(task_id, None)
                    self._forget_mark(task_id)
                    if task_id in self.accepted:
                        yield f"task {task_id} was accepted, and is withdrawn"
                case SubmissionRefused(reason=TaskReason.STORE_UNAVAILABLE):
                    self._refuse(event)

    def restart(self, restored: Iterable[Task], *, killed_at: float) -> Iterator[str]:
        """Continue with another server's restored tasks; yield errors in them."""
        found = {int(task.id): task.state for task in restored}
        for task_id in sorted(self.accepted - found.keys()):
            yield f"task {task_id} was accepted, and is lost by the restart"
        for task_id in self.given.keys() - found.keys():
            self._forget_mark(task_id)  # it never became durable: nobody was told
        yield from self._forget_what_was_lost(found, killed_at)
        self.withdrawn.difference_update(found)  # stored in time, unlike its withdrawal
        self.states = found

    def accept(self, task_id: int, client: str) -> Iterator[str]:
        """Note that a client was told the task of its submission; yield errors."""
        self.accepted.add(task_id)
        if task_id in self.withdrawn:
            yield f"{client} was told that task {task_id} is accepted, and it is withdrawn"
        elif task_id not in self.given:
            yield f"{client} was told of task {task_id}, and there is none"

    def tell(self, status: TaskStatus, client: str) -> Iterator[str]:
        """Note a status that a client received; ignore old versions; yield errors."""
        version, before = self.told.get((client, status.task_id), (0, TaskState.UNKNOWN))
        if status.version < version or not status.state:
            return
        state = TaskState(status.state)
        self.told[client, status.task_id] = status.version, state
        if before in TERMINAL and state is not before:
            yield f"{client} was told {before.name}, then {state.name} of task {status.task_id}"

    def compare(self, tasks: Iterable[Task]) -> Iterator[str]:
        """Compare the server's tasks with the ledger; yield errors."""
        found = {int(task.id): task.state for task in tasks}
        for task_id in sorted(self.accepted - found.keys()):
            yield f"task {task_id} was accepted, and is lost"
        for task_id in sorted(found.keys() ^ self.states.keys()):
            yield f"task {task_id} is not both in the journal and in the server"
        for task_id, state in found.items():
            if self.states.get(task_id, state) is not state:
                yield f"task {task_id} is {state.name}, by the journal {self.states[task_id].name}"

    def _submit(self, task: Task) -> Iterator[str]:
        if task.id in self.given and task.id not in self.withdrawn and task.id in self.states:
            yield f"id {task.id} was given twice"
        mark = _mark_of(task)
        if task.marks.nonce and mark in self._of_mark:
            twin = self._of_mark[mark]
            yield f"one submission of nonce {task.marks.nonce} is task {twin} and {task.id}"
        self._of_mark[mark] = task.id
        self.withdrawn.discard(task.id)  # by an earlier server, and the disk had nothing of it
        self.given[task.id] = mark
        self._asked[task.id] = str(task.submitter), task.submitted_at
        self.states[task.id] = task.state

    def _refuse(self, event: SubmissionRefused) -> None:
        """Handle a task that was cancelled before it was durable: it is over, and refused as well.

        It has not started and no client was told of its acceptance, so it may be submitted again.
        """
        for (_, _, vehicle, command, _), task_id in list(self._of_mark.items()):
            actor, at = self._asked[task_id]
            is_it = (vehicle, command, actor) == (event.vehicle, event.command, event.actor)
            is_over = self.states.get(task_id) in TERMINAL and task_id not in self.active
            if is_it and is_over and event.at - at <= NOT_STORED and task_id not in self.accepted:
                self._forget_mark(task_id)

    def _change(self, task_id: int, old: TaskState, new: TaskState) -> Iterator[str]:
        known = self.states.get(task_id)
        if known is None:
            yield f"task {task_id} changes and was never submitted"
        elif known is not old:
            yield f"task {task_id} changes from {old.name}, and was {known.name}"
        elif new not in TRANSITIONS.get(old, {}):
            yield f"task {task_id} goes from {old.name} to {new.name}"
        self.states[task_id] = new
        if new is TaskState.STARTING:
            self.active.add(task_id)

    def _forget_what_was_lost(self, found: dict[int, TaskState], killed_at: float) -> Iterator[str]:
        """Forget final states that clients were told but the disk lost; yield those told too early.

        A final state is told once the disk has it, or if the disk does not have it in time. A
        server that is killed in the second case comes back without it.
        """
        for (client, task_id), (_, state) in list(self.told.items()):
            if state in TERMINAL and found.get(task_id) is not state:
                self.taken_back += 1
                del self.told[client, task_id]
                if killed_at - self._ended_at.get(task_id, killed_at) < COMMIT:
                    yield f"{client} was told {state.name} of task {task_id}, and the disk was not"

    def _forget_mark(self, task_id: int) -> None:
        mark = self.given.get(task_id)
        if mark is not None and self._of_mark.get(mark) == task_id:
            del self._of_mark[mark]


def _mark_of(task: Task) -> Mark:
    submitter: Submitter = task.submitter
    endpoint = f"{submitter.link} {submitter.endpoint}"
    return endpoint, submitter.address, task.vehicle, task.command, task.marks.nonce
