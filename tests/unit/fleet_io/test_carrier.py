"""Datagrams between gateways by way of a real PostgreSQL."""

import select
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager

import pytest

from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.notification import SESSION, Datagram, Kind, Packet, Seal
from mav_tasks.fleet_io.carrier import OF_USE, Carrier
from mav_tasks.fleet_io.keeper import Trouble
from mav_tasks.fleet_io.lease_database import LeaseDatabase
from mav_tasks.store.postgres.address import parse
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until

LIMIT = 20.0  # s


@contextmanager
def carriers(url: str, *names: str) -> Iterator[list[Carrier]]:
    """Run carriers that have met."""
    LeaseDatabase(parse(url), "first", host="127.0.0.1", port=1).close()  # makes the tables
    with ExitStack() as ends:
        found = [ends.enter_context(closing(Carrier(parse(url), name))) for name in names]
        for name, it in zip(names, found, strict=True):
            others = frozenset(names) - {name}
            wait_until(lambda it=it, others=others: it.peers == others, within=LIMIT)  # type: ignore[misc]
        yield found


def taken(it: Carrier, is_enough: Callable[[list[Arrived]], bool]) -> list[Arrived]:
    """Wait by the descriptor until what has arrived is enough."""
    found: list[Arrived] = []
    end = time.monotonic() + LIMIT
    while not is_enough(found):
        assert time.monotonic() < end, found
        fd = it.fileno()
        assert fd is not None
        select.select([fd], [], [], 0.1)
        found += [each for each in it.take() if isinstance(each, Arrived)]
    return found


def test_a_datagram_goes_to_one_or_to_all(postgres: PostgresServer) -> None:
    with carriers(postgres.new_database(), "a", "b", "c") as (a, b, c):
        a.send("b", b"for b")
        a.send("", b"for all")
        assert [each.payload for each in taken(b, lambda found: len(found) == 2)] == [
            b"for b",
            b"for all",
        ]
        (found,) = taken(c, lambda found: len(found) == 1)
        assert (found.sender, found.payload) == ("a", b"for all")
        assert found.waited < LIMIT


def test_a_stop_is_not_lost_when_the_database_restarts(postgres: PostgresServer) -> None:
    with carriers(postgres.new_database(), "a", "b") as (a, b):
        postgres.stop()
        wait_until(lambda: any(isinstance(each, Trouble) for each in b.take()), within=LIMIT)
        a.send("b", b"late telemetry")
        too_late = time.monotonic() + OF_USE
        wait_until(lambda: time.monotonic() > too_late, within=LIMIT)
        postgres.start()
        end = time.monotonic() + LIMIT
        stops = 0
        while not stops:  # as a client repeats it
            assert time.monotonic() < end
            a.send("b", b"stop", first=True)
            found = [each.payload for each in b.take() if isinstance(each, Arrived)]
            assert b"late telemetry" not in found
            stops += found.count(b"stop")
            time.sleep(0.05)


def test_another_role_cannot_speak_for_a_gateway(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with carriers(url, "a", "b") as (a, b), connected(url) as stranger:
        (fleet,) = stranger.execute("SELECT fleet FROM meta").fetchone()
        channel = Seal(b"a guess", fleet).channel("b")  # it is no secret, the key is
        forged = Packet(Kind.MAIL, "a", bytes(SESSION), 10**6, datagrams=[Datagram(b"drive")])
        texts = ("", "AAAA", "A" * 4000, Seal(b"a guess", fleet).text(forged, bytes(SESSION)))
        for text in texts:
            stranger.execute("SELECT pg_notify(%s, %s)", (channel, text))
        a.send("b", b"true")
        assert [each.payload for each in taken(b, bool)] == [b"true"]
        wait_until(lambda: b.counts.refused >= len(texts), within=LIMIT)


def test_too_long_a_datagram_and_a_bad_name_are_refused(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with pytest.raises(ValueError, match="up to 40 letters"):
        Carrier(parse(url), "a b")
    with carriers(url, "a", "b") as (a, _), pytest.raises(ValueError, match="401 bytes"):
        a.send("b", b"x" * 401)
