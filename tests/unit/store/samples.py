"""Events and stores, made by hand."""

import select
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mav_tasks.settings import Retention
from mav_tasks.store import Kept, NotKept, Outcome, Store
from mav_tasks.store.durable import DurableStore
from mav_tasks.store.opening import kind_of
from mav_tasks.tasks.events import TaskSubmitted
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Marks, Task, TaskId, Terms
from tests.unit.tasks.samples import SOMEBODY, TASK_MOVE

OFFSET = 1_800_000_000.0  # s, UTC minus monotonic; a whole number loses nothing of the samples
FOR_EVER = Retention(max_age=None, max_count=None)
PATIENCE = 20.0  # s


def submitted(number: int, *, at: float = 100.0) -> TaskSubmitted:
    """Return the event of a submission; times are exact in binary."""
    task = Task(
        id=TaskId(number),
        vehicle=1,
        command=TASK_MOVE,
        goal=Move(number / 4),
        submitter=SOMEBODY,
        marks=Marks(number, "payload", "packet"),
        submitted_at=at,
        terms=Terms(priority=7, deadline=at + 60),
    )
    return TaskSubmitted(task, at)


def finish(registry: TaskRegistry, number: int, *, now: float) -> None:
    """Let a waiting task be cancelled."""
    registry.change(
        TaskId(number), TaskState.CANCELLED, reason=TaskReason.CANCELLED, actor="client", now=now
    )


@contextmanager
def opened(
    place: str | Path, *, offset: float = OFFSET, retention: Retention = FOR_EVER
) -> Iterator[DurableStore]:
    """Return the store at a place, of any durable kind; it is closed after the block."""
    store = kind_of(str(place)).open_store(str(place), lambda: offset, retention)
    assert isinstance(store, DurableStore)
    try:
        yield store
    finally:
        store.close()


def wait_for(store: Store, through: int) -> list[Outcome]:
    """Wait until events are kept, woken by the descriptor; gives all outcomes until then."""
    outcomes: list[Outcome] = []
    while Kept(through) not in outcomes:
        outcomes += next_outcomes(store)
    return outcomes


def wait_for_failure(store: Store) -> NotKept:
    """Wait until the store says that something is not kept."""
    while True:
        for outcome in next_outcomes(store):
            if isinstance(outcome, NotKept):
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
