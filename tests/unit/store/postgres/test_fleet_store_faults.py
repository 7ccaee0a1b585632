"""Gateways that are killed or stopped while they write, and what the others then have."""

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.clock import boot_time
from mav_tasks.errors import StoreError
from mav_tasks.fleet.member import Renew, Take
from mav_tasks.settings import Retention
from mav_tasks.store import IdsGranted, VehiclesLoaded, Which
from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import Encoder
from mav_tasks.store.connection import Connection
from mav_tasks.store.holder import Replaced
from mav_tasks.store.opening import kind_of
from mav_tasks.store.postgres import address, fleet_database, fleet_loader, session
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.fleet_database import FleetDatabase
from mav_tasks.store.reading import read_restored
from mav_tasks.store.retention import Trimmer
from mav_tasks.tasks.events import Event, QueuePaused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.signing_lead import STEP
from rover_sim.postgres import installed
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until
from tests.kit.volume import some
from tests.unit.store.postgres.gateways import (
    PATIENCE,
    Gateway,
    gateways,
    hanging,
    ids_in,
    of_vehicle,
)
from tests.unit.store.samples import FOR_EVER, OFFSET, opened, submitted

ROOT = Path(__file__).resolve().parents[4]


@pytest.fixture
def url(postgres: PostgresServer) -> str:
    return postgres.new_database()


@contextmanager
def child(*arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """Run a gateway in a process of its own, which is killed after the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.unit.store.postgres.gateway_child", *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "begun\n"
        yield process
    finally:
        process.kill()
        process.wait(PATIENCE)
        process.stdout.close()


def is_stopped(process: "subprocess.Popen[str]") -> bool:
    """Return whether a process has stopped itself (SIGSTOP)."""
    status = Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8")
    return status.rpartition(")")[2].split()[0] == "T"


def evict(by: Gateway, name: str) -> None:
    """End the lease of another gateway, as soon as the database lets one."""
    while True:
        try:
            by.evict_named(name)
        except PostgresError:  # it gives up waiting soon
            by.leases.connect()
        else:
            return


@pytest.mark.parametrize("life", some([1, 40, 400], 0, 1))
def test_another_gateway_has_all_that_a_killed_one_had_kept(url: str, life: int) -> None:
    with gateways(url, "b") as (b,), child(url, "a") as process:
        assert process.stdout is not None
        said = 0
        while said < life:
            said = int(process.stdout.readline().split()[1])
            b.store.append([of_vehicle(100_000 + said, 2)])
        process.send_signal(signal.SIGKILL)
        process.wait(PATIENCE)
        for rest in process.stdout:
            said = int(rest.split()[1])
        evict(b, "a")
        b.store.load_vehicles(frozenset({1}))
        ids = [task.id for task in b.next(VehiclesLoaded).restored.tasks]
        assert ids == list(range(1, len(ids) + 1))
        assert len(ids) >= said
    with closing(kind_of(url).open_journal(url, Which())) as journal:
        entries = list(journal.take(offset=OFFSET))
    assert [number for number, _ in entries] == list(range(1, len(ids_in(url)) + 1))


@pytest.mark.parametrize("point", ["write", "trim"])
def test_a_gateway_that_stops_while_it_writes_holds_nobody_up(url: str, point: str) -> None:
    """Its machine lives, so that the database sees no broken connection."""
    with gateways(url, "b") as (b,), child(url, "a", point) as process:
        wait_until(lambda: is_stopped(process), within=PATIENCE)
        evict(b, "a")
        b.store.append([of_vehicle(100_000, 2)])
        b.kept(1)
        process.send_signal(signal.SIGCONT)
        b.store.append([of_vehicle(100_001, 2)])
        b.kept(2)
        assert ids_in(url) == [100_000, 100_001]


def batch_of(database: FleetDatabase, number: int) -> Batch:
    """Return the next events of a gateway: a submission and an entry of the journal."""
    events: list[Event] = [submitted(number), QueuePaused(1, R.OPERATOR, "client", 10.0)]
    first, form = database.last_number + 1, database.format_id
    return Batch(events, first=first, encoder=Encoder(), format_id=form, offset=OFFSET)


def test_a_lost_session_that_still_commits_leaves_nothing_twice(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The new session has asked what is stored before the old one's transaction was over."""
    patient = session.Limits(answer=PATIENCE, statement=PATIENCE, lock=PATIENCE)
    monkeypatch.setattr(session, "Limits", lambda: patient)
    with gateways(url, "a") as (a,):
        a.next(IdsGranted)
        old = FleetDatabase(address.parse(url), "a", a.epoch)
        old.begin()
        new = FleetDatabase(address.parse(url), "a", a.epoch)
        new.begin()
        failures: list[Exception] = []

        def write(database: FleetDatabase) -> None:
            try:
                database.write(batch_of(database, 1), utc=1.0)
            except PostgresError as error:
                failures.append(error)

        threads = [threading.Thread(target=write, args=(each,)) for each in (old, new)]
        with hanging(url) as hang:
            threads[0].start()
            wait_until(hang.is_waited_for, within=PATIENCE)
            new.reopen()
            threads[1].start()
            wait_until(lambda: hang.waiting() == 2, within=PATIENCE)
        for each in threads:
            each.join(PATIENCE)
        (failure,) = failures
        assert new.failure(failure) is not None
        assert not isinstance(failure, Replaced)
        new.reopen()
        assert new.last_number == 2
        old.close(utc=None)
        new.close(utc=None)
    with connected(url) as connection:
        rows = connection.execute("SELECT number FROM journal UNION ALL SELECT number FROM tasks")
        assert sorted(rows.fetchall()) == [(1,), (2,)]


def test_a_standby_is_not_asked_what_a_vehicle_has(postgres: PostgresServer, url: str) -> None:
    """It may not have yet what the former holder has stored."""
    standby = PostgresServer(installed())
    try:
        standby.start()
        name = url.rpartition("/")[2]
        standby.create_database(name)
        with opened(standby.url(name)):
            pass
        both = url.replace("@", f"@127.0.0.1:{standby.port},")
        with standby.as_replica(), gateways(url, "a") as (a,):
            a.store.append([submitted(1)])
            a.kept(1)
            a.store.close()
            a.open(both)
            a.store.load_vehicles(frozenset({1}))
            assert [task.id for task in a.next(VehiclesLoaded).restored.tasks] == [1]
            a.store.close()
            with opened(both) as store:
                assert [task.id for task in store.load().tasks] == [1]
    finally:
        standby.close()


def test_a_lead_of_signatures_grows_once_for_each_takeover(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has an upper bound, at which the vehicle would no longer refuse the former holder."""
    failures = [StoreError("the database took too long")] * 3

    def read(*arguments: Any, **more: Any) -> Restored:
        if failures:
            raise failures.pop()
        return read_restored(*arguments, **more)

    monkeypatch.setattr(fleet_loader, "read_restored", read)
    with gateways(url, "a") as (a,):
        a.leases.execute(Take(Renew("a", a.epoch), frozenset({1})))
        a.store.load_vehicles(frozenset({1}))
        assert a.next(VehiclesLoaded).restored.signing_lead == STEP
    assert not failures


def test_ids_of_three_gateways_are_unique(url: str) -> None:
    taken: list[int] = []

    def use(gateway: Gateway) -> None:
        for _ in range(4):
            grant = gateway.next(IdsGranted)
            taken.extend(range(grant.first, grant.first + grant.count))
            gateway.store.append([submitted(grant.first + number) for number in range(1_000)])

    with gateways(url, "a", "b", "c") as found:
        threads = [threading.Thread(target=use, args=(each,)) for each in found]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        for gateway in found:
            gateway.kept(4_000)
    assert len(taken) == len(set(taken)) == 12_000
    assert len(ids_in(url)) == 12_000


class Looking(Trimmer):
    """Looks, in its step, whether another session could write."""

    def __init__(self, url: str) -> None:
        super().__init__(FOR_EVER)
        self._url = url
        self.steps = 0

    def step(self, connection: Connection, *, utc: float, **options: Any) -> bool:
        with connected(self._url) as other:
            other.execute("SELECT 1 FROM meta FOR UPDATE NOWAIT")
        self.steps += 1
        return super().step(connection, utc=utc, **options)


def test_a_gateway_that_deletes_expired_rows_keeps_no_other_from_writing(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does a clock that is set tell that the fleet is at work, but only the time."""
    trimmer = Looking(url)
    with gateways(url, "a") as (a,), connected(url) as other:

        def is_at_work() -> bool:
            found = other.execute("SELECT last_write FROM meta").fetchone()[0]
            return found is not None

        database = FleetDatabase(address.parse(url), "a", a.epoch)
        database.begin()
        for utc in (1_000.0, 5_000.0):
            database.trim(trimmer, utc=utc)
            assert not is_at_work()
        later = boot_time() + fleet_database.AT_WORK
        monkeypatch.setattr(fleet_database, "boot_time", lambda: later)
        database.trim(trimmer, utc=1_000.0)
        assert is_at_work()
        database.close(utc=None)
    assert trimmer.steps == 3


@pytest.mark.parametrize("wrong", [-3600.0, 3600.0])
def test_a_clock_that_is_set_changes_neither_idle_times_nor_leads(url: str, wrong: float) -> None:
    """Queues of a fleet that was at work just now go on; the fence at the vehicle stays one."""
    with gateways(url, "a") as (a,):
        a.leases.execute(Take(Renew("a", a.epoch), frozenset({1})))
        a.store.append([of_vehicle(1, 1)])
        a.kept(1)
        a.store.load_vehicles(frozenset({1}))
        assert a.next(VehiclesLoaded).restored.signing_lead == STEP
        a.store.close()
        a.open(wall_offset=OFFSET + wrong)
        a.store.load_vehicles(frozenset({1}))
        restored = a.next(VehiclesLoaded).restored
        assert restored.idle < 60.0
        assert restored.signing_lead == (2 * STEP if wrong < 0 else STEP)


def test_one_gateway_at_a_time_deletes_expired_rows(url: str) -> None:
    class Trimming(Trimmer):
        def step(self, connection: Connection, *, utc: float, **options: Any) -> bool:
            assert not other.trim(Looking(url), utc=utc)  # it does not even look
            return super().step(connection, utc=utc, **options)

    with gateways(url, "a", "b") as (a, b):
        first, other = (FleetDatabase(address.parse(url), g.name, g.epoch) for g in (a, b))
        first.begin()
        other.begin()
        never = Trimming(Retention(max_age=None, max_count=0))
        first.trim(never, utc=1_000.0)
        for each in (first, other):
            each.close(utc=None)
