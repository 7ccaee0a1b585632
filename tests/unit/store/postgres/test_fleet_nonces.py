"""Nonces of tasks for any vehicle: unique in a fleet, as the database decides."""

from dataclasses import replace

import pytest

from mav_tasks.engine.inputs import Committed, NonceTaken, VehiclesTaken
from mav_tasks.tasks.events import Event, TaskAssigned, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.task import Marks, TaskId
from tests.kit.postgres import PostgresServer
from tests.kit.processes import wait_until
from tests.unit.store.postgres.gateways import PATIENCE, Gateway, gateways, hanging, ids_in
from tests.unit.store.samples import submitted

NONCE = 77


@pytest.fixture
def url(postgres: PostgresServer) -> str:
    return postgres.new_database()


def to_any(
    number: int, *, vehicle: int = 1, payload: str = "payload", nonce: int = NONCE
) -> list[Event]:
    """Return the events of a submission to any vehicle."""
    task = replace(
        submitted(number).task, vehicle=vehicle, marks=Marks(nonce, payload), choice="free"
    )
    assigned = TaskAssigned(task.id, vehicle, 1, 0, task.choice, task.submitted_at)
    return [TaskSubmitted(task, task.submitted_at), assigned]


def outcomes_of(it: Gateway, count: int) -> list[NonceTaken | Committed]:
    """Return what was told until so many events are kept, in order."""
    found: list[NonceTaken | Committed] = []
    while not found or not (isinstance(found[-1], Committed) and found[-1].through >= count):
        outcome = it.next(NonceTaken | Committed)  # type: ignore[arg-type]
        assert isinstance(outcome, NonceTaken | Committed)
        found.append(outcome)
    return found


def test_the_second_task_with_a_nonce_is_not_stored_and_that_is_told_first(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        a.store.append(to_any(1))
        assert outcomes_of(a, 2) == [Committed(2)]
        b.store.append([*to_any(1001, vehicle=2), submitted(1002)])
        assert outcomes_of(b, 3) == [NonceTaken(1001, 1, "payload"), Committed(3)]
        assert ids_in(url) == [1, 1002]
        b.store.load_vehicles(frozenset({2}))
        assert b.next(VehiclesTaken).restored.tasks == ()
        b.store.append([TaskWithdrawn(TaskId(1001), 2, 101.0)])
        b.kept(4)
        events = [event for _, event in b.store.journal()]
        assert [each for each in events if isinstance(each, TaskWithdrawn)]
        assert len([each for each in events if isinstance(each, TaskSubmitted)]) == 3


def test_named_vehicles_other_nonces_and_other_clients_are_not_compared(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        a.store.append(to_any(1))
        a.kept(2)
        other = to_any(1003)
        assert isinstance(other[0], TaskSubmitted)
        task = other[0].task
        stranger = TaskSubmitted(
            replace(task, submitter=replace(task.submitter, fingerprint="another")),
            task.submitted_at,
        )
        named = TaskSubmitted(replace(task, id=TaskId(1004), choice=""), task.submitted_at)
        b.store.append([*to_any(1001, nonce=78), *to_any(1002, nonce=0), stranger, named])
        assert outcomes_of(b, 6) == [Committed(6)]
        assert ids_in(url) == [1, 1001, 1002, 1003, 1004]


def test_of_two_batches_at_once_the_first_that_is_committed_has_the_nonce(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        with hanging(url) as hang:
            a.store.append(to_any(1))
            b.store.append(to_any(1001))
            wait_until(lambda: hang.waiting() >= 2, within=PATIENCE)
        told = outcomes_of(a, 2) + outcomes_of(b, 2)
        (taken,) = (each for each in told if isinstance(each, NonceTaken))
        assert {taken.task_id, taken.known} == {1, 1001}
        assert ids_in(url) == [taken.known]
