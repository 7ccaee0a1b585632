"""Nonces of tasks for any vehicle: unique in a fleet, as the database decides."""

from contextlib import closing
from dataclasses import replace

import pytest

from mav_tasks.clock import boot_time
from mav_tasks.store import Kept, NonceTaken, VehiclesLoaded
from mav_tasks.tasks.deduplicator import NONCE_KEPT
from mav_tasks.tasks.events import Event, TaskAssigned, TaskChanged, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Marks, Progress, TaskId
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until
from tests.kit.tcp_proxy import TcpProxy
from tests.unit.store.postgres.gateways import PATIENCE, Gateway, gateways, hanging, ids_in
from tests.unit.store.samples import OFFSET, submitted

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


def ended(number: int, *, at: float) -> TaskChanged:
    task_id = TaskId(number)
    return TaskChanged(task_id, 1, 2, S.QUEUED, S.CANCELLED, R.CANCELLED, "client", at, Progress())


def outcomes_of(it: Gateway, count: int) -> list[NonceTaken | Kept]:
    """Return what was told until so many events are kept, in order."""
    found: list[NonceTaken | Kept] = []
    while not found or not (isinstance(found[-1], Kept) and found[-1].through >= count):
        outcome = it.next(NonceTaken | Kept)  # type: ignore[arg-type]
        assert isinstance(outcome, NonceTaken | Kept)
        found.append(outcome)
    return found


def test_the_second_task_with_a_nonce_is_not_stored_and_that_is_told_first(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        a.store.append(to_any(1))
        assert outcomes_of(a, 2) == [Kept(2)]
        b.store.append([*to_any(1001, vehicle=2), submitted(1002)])
        assert outcomes_of(b, 3) == [NonceTaken(1001, 1, "payload"), Kept(3)]
        assert ids_in(url) == [1, 1002]
        b.store.load_vehicles(frozenset({2}))
        assert b.next(VehiclesLoaded).restored.tasks == ()
        b.store.append([TaskWithdrawn(TaskId(1001), 2, 101.0)])
        b.kept(4)
        events = [event for _, event in b.store.journal()]
        assert [each for each in events if isinstance(each, TaskWithdrawn)]
        assert len([each for each in events if isinstance(each, TaskSubmitted)]) == 3


def test_another_payload_is_told_so_that_it_is_refused(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        a.store.append(to_any(1))
        a.kept(2)
        b.store.append(to_any(1001, payload="other"))
        assert outcomes_of(b, 2)[0] == NonceTaken(1001, 1, "payload")


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
        assert outcomes_of(b, 6) == [Kept(6)]
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


def test_a_nonce_is_free_when_its_task_is_withdrawn_deleted_or_long_over(url: str) -> None:
    now = boot_time()
    with gateways(url, "a", "b") as (a, b):
        a.store.append([*to_any(1), TaskWithdrawn(TaskId(1), 1, 101.0), *to_any(2)])
        assert outcomes_of(a, 5) == [Kept(5)]
        a.store.append([ended(2, at=now - NONCE_KEPT + 60.0)])
        a.kept(6)
        b.store.append(to_any(1001))
        assert outcomes_of(b, 2)[0] == NonceTaken(1001, 2, "payload")
        with connected(url) as connection:
            utc = now + OFFSET - NONCE_KEPT - 1.0
            connection.execute("UPDATE tasks SET changed_at = %s", (utc,))
        b.store.append(to_any(1002))
        assert outcomes_of(b, 4) == [Kept(4)]
        with connected(url) as connection:
            connection.execute("DELETE FROM tasks")
        a.store.append(to_any(3))
        assert outcomes_of(a, 8) == [Kept(8)]


def test_a_refusal_whose_answer_was_lost_is_told_all_the_same(
    postgres: PostgresServer, url: str
) -> None:
    with gateways(url, "a", "b") as (a, b), closing(TcpProxy(postgres.port)) as proxy:
        a.store.append(to_any(1))
        a.kept(2)
        b.store.close()
        b.open(f"postgresql://postgres@127.0.0.1:{proxy.port}/{url.rpartition('/')[2]}")
        with hanging(url) as hang:
            b.store.append(to_any(1001))
            wait_until(hang.is_waited_for, within=PATIENCE)
            proxy.fall_silent()
        assert outcomes_of(b, 2) == [NonceTaken(1001, 1, "payload"), Kept(2)]
        assert ids_in(url) == [1]


def test_a_task_that_moved_is_loaded_with_its_new_vehicle_only(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        moved = TaskAssigned(TaskId(1), 2, 2, 1, "rover 1: silent; free", 102.0)
        a.store.append([*to_any(1), moved])
        a.kept(3)
        b.store.load_vehicles(frozenset({1}))
        assert b.next(VehiclesLoaded).restored.tasks == ()
        b.store.load_vehicles(frozenset({2}))
        (task,) = b.next(VehiclesLoaded).restored.tasks
        assert (task.vehicle, task.choice, task.version) == (2, moved.choice, 2)
