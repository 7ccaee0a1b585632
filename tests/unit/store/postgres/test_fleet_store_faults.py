"""Gateways that are killed or stopped while they write, and what the others then have."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from mav_tasks.engine.inputs import VehiclesTaken
from mav_tasks.fleet.member import Renew, Take
from mav_tasks.store import Which, kind_of
from mav_tasks.store.postgres.failures import PostgresError
from tests.kit.postgres import PostgresServer
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
from tests.unit.store.samples import OFFSET

STEP = 3.0  # s, by which the next holder of a vehicle signs ahead
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
        ids = [task.id for task in b.next(VehiclesTaken).restored.tasks]
        assert ids == list(range(1, len(ids) + 1))
        assert len(ids) >= said
    with closing(kind_of(url).open_journal(url, Which())) as journal:
        entries = list(journal.take(offset=OFFSET))
    assert [number for number, _ in entries] == list(range(1, len(ids_in(url)) + 1))


@pytest.mark.parametrize("wrong", [-3600.0, 3600.0])
def test_a_clock_that_is_set_changes_neither_idle_times_nor_leads(url: str, wrong: float) -> None:
    """Queues of a fleet that was at work just now go on; the fence at the vehicle stays one."""
    with gateways(url, "a") as (a,):
        a.asks(Take(Renew("a", a.epoch), frozenset({1})))
        a.store.append([of_vehicle(1, 1)])
        a.kept(1)
        a.store.load_vehicles(frozenset({1}))
        assert a.next(VehiclesTaken).restored.signing_lead == STEP
        a.store.close()
        a.open(wall_offset=OFFSET + wrong)
        a.store.load_vehicles(frozenset({1}))
        restored = a.next(VehiclesTaken).restored
        assert restored.idle < 60.0
        assert restored.signing_lead == (2 * STEP if wrong < 0 else STEP)


def test_a_gateway_that_stops_while_it_writes_holds_nobody_up(url: str) -> None:
    """Its machine lives, so that the database sees no broken connection."""
    with gateways(url, "b") as (b,), child(url, "a") as process:
        assert process.stdout is not None
        process.stdout.readline()
        with hanging(url) as hang:
            wait_until(hang.is_waited_for, within=PATIENCE)
            process.send_signal(signal.SIGSTOP)
        evict(b, "a")
        stored = len(ids_in(url))
        b.store.append([of_vehicle(100_000, 2)])
        b.kept(1)
        process.send_signal(signal.SIGCONT)
        b.store.append([of_vehicle(100_001, 2)])
        b.kept(2)
        assert ids_in(url)[stored:] == [100_000, 100_001]
