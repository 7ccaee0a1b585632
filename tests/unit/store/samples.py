"""Events and stores, made by hand."""

import select
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import Committed, StoreFailed
from mav_tasks.kinds import Move
from mav_tasks.store import Outcome, Store, kind_of
from mav_tasks.tasks.events import Event, TaskChanged, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Marks, Progress, Submitter, Task, TaskId, Terms

OFFSET = 1_800_000_000.0  # s, UTC minus monotonic; a whole number loses nothing of the samples
FOR_EVER = Retention(max_age=None, max_count=None)
PATIENCE = 20.0  # s
SOMEBODY = Submitter("udpin:127.0.0.1:14560", "127.0.0.1:50000", 255, 190)
TASK_MOVE = 54000


def submitted(number: int, *, at: float = 100.0, vehicle: int = 1) -> TaskSubmitted:
    """Return the event of a submission; times are exact in binary."""
    task = Task(
        id=TaskId(number),
        vehicle=vehicle,
        command=TASK_MOVE,
        goal=Move(number / 4),
        submitter=SOMEBODY,
        marks=Marks(number, "payload", "packet"),
        submitted_at=at,
        terms=Terms(priority=7, deadline=at + 60),
    )
    return TaskSubmitted(task, at)


def changed(
    task: Task, new: TaskState, *, at: float, progress: Progress | None = None
) -> tuple[Task, TaskChanged]:
    """Return a task in its next state, and the event of that."""
    after = replace(
        task,
        state=new,
        reason=TaskReason.OPERATOR,
        version=task.version + 1,
        progress=progress or task.progress,
        changed_at=at,
    )
    event = TaskChanged(
        task.id,
        task.vehicle,
        after.version,
        task.state,
        new,
        after.reason,
        "client",
        at,
        after.progress,
    )
    return after, event


def cancelled(number: int, *, at: float, vehicle: int = 1) -> list[Event]:
    """Return the events of a task that is submitted, and cancelled half a second later."""
    first = submitted(number, at=at, vehicle=vehicle)
    return [first, changed(first.task, TaskState.CANCELLED, at=at + 0.5)[1]]


@contextmanager
def opened(
    place: str | Path, *, offset: float = OFFSET, retention: Retention = FOR_EVER
) -> Iterator[Store]:
    """Return the store at a place, of any durable kind; it is closed after the block."""
    store = kind_of(str(place)).open_store(str(place), lambda: offset, retention)
    try:
        yield store
    finally:
        store.close()


def loaded(store: Store) -> Restored:
    """Return the state that a durable store has kept."""
    found = store.load()
    assert found is not None
    return found


def keep(store: Store, *events: Event) -> list[Outcome]:
    """Append the first events of a store's life; return all outcomes until they are kept."""
    store.append(events)
    return wait_for(store, len(events))


def wait_for(store: Store, through: int) -> list[Outcome]:
    """Wait until events are kept, woken by the descriptor; gives all outcomes until then."""
    outcomes: list[Outcome] = []
    while Committed(through) not in outcomes:
        outcomes += next_outcomes(store)
    return outcomes


def wait_for_failure(store: Store) -> StoreFailed:
    """Wait until the store says that something is not kept."""
    while True:
        for outcome in next_outcomes(store):
            if isinstance(outcome, StoreFailed):
                return outcome


def next_outcomes(store: Store) -> list[Outcome]:
    """Wait for the next outcomes."""
    began = time.monotonic()
    descriptor = store.fileno()
    if descriptor is None:  # outcomes are there at once
        return store.take_outcomes()
    ready, _, _ = select.select([descriptor], [], [], PATIENCE)
    assert ready, f"no outcome in {time.monotonic() - began:.0f} s"
    return store.take_outcomes()
