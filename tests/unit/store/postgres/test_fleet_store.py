"""The store that gateways share: fenced by their leases, one order of events for all readers."""

import threading
import time
from collections.abc import Sequence
from contextlib import closing

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.engine.inputs import IdsGranted, VehiclesTaken
from mav_tasks.fleet.member import Renew, Take
from mav_tasks.store import Evicted, Which, kind_of
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.tasks.events import Event, QueuePaused, VehicleHalted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until
from tests.kit.tcp_proxy import TcpProxy
from tests.unit.store.postgres.gateways import (
    PATIENCE,
    Gateway,
    away,
    gateways,
    hanging,
    ids_in,
    of_vehicle,
)
from tests.unit.store.samples import OFFSET, changed, loaded, opened, submitted


@pytest.fixture
def url(postgres: PostgresServer) -> str:
    return postgres.new_database()


def test_a_gateway_begins_with_nothing_but_ids(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        assert (loaded(a.store).tasks, loaded(a.store).gateway) == ((), "a")
        assert a.next(IdsGranted) == IdsGranted(1, 1000)
        assert b.next(IdsGranted) == IdsGranted(1001, 1000)
        a.store.append([submitted(number) for number in range(1, 502)])
        assert a.next(IdsGranted) == IdsGranted(2001, 1000)


def test_another_gateway_loads_what_one_has_stored_about_a_vehicle(url: str) -> None:
    firsts = [of_vehicle(number, vehicle) for number, vehicle in ((1, 1), (2, 2), (3, 1))]
    starting, began = changed(firsts[0].task, S.STARTING, at=101.0)
    over, end = changed(firsts[2].task, S.CANCELLED, at=102.0)
    pauses = [QueuePaused(number, R.OPERATOR, "client", 110.0) for number in (1, 2)]
    halts = [VehicleHalted(number, 6 + number, R.OPERATOR, "client", 110.0) for number in (1, 2)]
    events: list[Event] = [*firsts, began, end, *pauses, *halts]
    with gateways(url, "a", "b") as (a, b):
        a.store.append(events)
        a.kept(len(events))
        b.store.load_vehicles(frozenset({1}))
        found = b.next(VehiclesTaken)
        assert found.vehicles == (1,)
        assert found.restored.tasks == (starting, over)
        assert found.restored.paused == {1: R.OPERATOR}
        assert found.restored.halt_epochs == {1: 7}
        assert not found.restored.ended_well


def test_after_an_eviction_nothing_is_written_and_it_is_told_once(url: str) -> None:
    with gateways(url, "a", "b") as (a, b):
        a.store.append([submitted(1)])
        a.kept(1)
        b.evict(a)
        a.store.append([submitted(2)])
        assert "gateway a" in a.next(Evicted).text
        a.store.append([submitted(3)])
        a.store.load_vehicles(frozenset({1}))
        began = time.monotonic()
        a.store.close()
        assert time.monotonic() - began < 2.5  # it does not try for long
        assert not [each for each in a.store.take_outcomes() if not isinstance(each, VehiclesTaken)]
        assert ids_in(url) == [1]


def stop(vehicle: int) -> Sequence[Event]:
    """Return the events of a STOP."""
    pause = QueuePaused(vehicle, R.STOPPED, "client", 100.0)
    return [VehicleHalted(vehicle, 5, R.STOPPED, "client", 100.0), pause]


def test_a_write_in_flight_is_over_before_an_eviction_ends(url: str) -> None:
    """Either the eviction waits for the write, or the write fails: never both in between."""
    with gateways(url, "a", "b") as (a, b):
        done = threading.Event()

        def evict() -> None:
            while not done.is_set():
                try:
                    b.evict(a)
                    done.set()
                except PostgresError:  # it gives up waiting, and tries again
                    b.leases.connect()

        thread = threading.Thread(target=evict)
        with hanging(url) as hang:
            a.store.append([submitted(1)])
            wait_until(hang.is_waited_for, within=PATIENCE)
            renewed = a.leases.execute(Renew("a", a.epoch))  # is not kept waiting by the write
            assert renewed.row.epoch == a.epoch
            thread.start()
            assert not done.wait(0.5)
        assert done.wait(PATIENCE)
        thread.join()
        a.kept(1)
        a.store.append([submitted(2)])
        a.next(Evicted)
        assert ids_in(url) == [1]


def test_a_reader_follows_several_writers_without_a_gap(url: str) -> None:
    """A number that is committed later than a higher one would be missed for ever."""
    count, each = 400, ("a", "b", "c")
    with gateways(url, *each) as found:
        journal = kind_of(url).open_journal(url, Which())
        seen: list[int] = []
        threads = []
        for place, it in enumerate(found):

            def write(it: Gateway = it, first: int = 10_000 * (place + 1)) -> None:
                for number in range(count):
                    it.store.append([of_vehicle(first + number, 1)])
                    if number % 7 == 0:
                        it.kept(number + 1)
                it.kept(count)

            threads.append(threading.Thread(target=write))
        for thread in threads:
            thread.start()
        with closing(journal):
            while any(thread.is_alive() for thread in threads):
                seen += [number for number, _ in journal.take(offset=OFFSET)]
            seen += [number for number, _ in journal.take(offset=OFFSET)]
        for thread in threads:
            thread.join()
        assert seen == list(range(1, 3 * count + 1))


def test_a_commit_whose_answer_was_lost_is_not_made_twice(
    postgres: PostgresServer, url: str
) -> None:
    with gateways(url, "a") as (a,), closing(TcpProxy(postgres.port)) as proxy:
        a.store.close()
        a.open(f"postgresql://postgres@127.0.0.1:{proxy.port}/{url.rpartition('/')[2]}")
        a.store.append([submitted(1)])
        a.kept(1)
        with hanging(url) as hang:
            a.store.append([submitted(2)])
            wait_until(hang.is_waited_for, within=PATIENCE)
            proxy.fall_silent()
        wait_until(lambda: ids_in(url) == [1, 2], within=PATIENCE)
        a.kept(2)
        a.store.append([submitted(3)])
        a.kept(3)
        assert ids_in(url) == [1, 2, 3]


def test_one_server_and_gateways_exclude_each_other(url: str) -> None:
    with opened(url), pytest.raises(StoreError, match="in use by the server on"):
        Gateway(url, "a")
    with connected(url) as connection:
        connection.execute("UPDATE gateways SET epoch = 0")
    with (
        gateways(url, "b", "c"),
        pytest.raises(StoreError, match="in use by a fleet: gateway b, gateway c"),
        opened(url),
    ):
        pass


def test_a_stop_that_only_the_local_record_has_is_in_force_after_the_next_start(
    postgres: PostgresServer, url: str
) -> None:
    with gateways(url, "a", "b") as (a, b):
        b.store.append([VehicleHalted(2, 9, R.OPERATOR, "c", 100.0)])  # it is newer than the STOP
        b.kept(1)
        with away(postgres, a, b):
            a.store.append([*stop(1), *stop(2)])
            a.store.close()
        b.evict(a)
        a.join()
        a.store.load_vehicles(frozenset({1, 2}))
        restored = a.next(VehiclesTaken).restored
        assert restored.paused == {1: R.STOPPED}
        assert restored.halt_epochs == {1: 5, 2: 9}


def test_a_stop_of_a_vehicle_that_another_gateway_has_now_stays_local(
    postgres: PostgresServer, url: str
) -> None:
    with gateways(url, "a", "b") as (a, b):
        with away(postgres, a, b):
            a.store.append(stop(1))
            a.store.close()
        b.evict(a)
        b.asks(Take(Renew("b", b.epoch), frozenset({1})))
        a.join()
        a.store.load_vehicles(frozenset({1}))
        assert a.next(VehiclesTaken).restored.paused == {}
