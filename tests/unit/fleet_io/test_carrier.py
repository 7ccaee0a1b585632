"""Datagrams between gateways by way of a real PostgreSQL."""

import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psycopg
import pytest

from mav_tasks.clock import boot_time
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.notification import SESSION, Datagram, Kind, Packet, Seal
from mav_tasks.fleet.outbox import LIMIT as OUTBOX
from mav_tasks.fleet_io.carrier import OF_USE, RETRY, Carrier
from mav_tasks.fleet_io.keeper import Trouble
from mav_tasks.store.postgres.address import parse
from tests.kit.carriers import LIMIT, carriers
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import Process, process, wait_until

QUEUE_PAGES = 64  # of the server's queue of notifications, the least; none has two long ones
FULL = (
    "the server's queue of notifications is full: end the session that listens and does not end"
    " its transaction (pg_stat_activity) (too many notifications in the NOTIFY queue)"
)
RECEIVER = """
import select, sys
from mav_tasks.fleet_io.carrier import Carrier
from mav_tasks.store.postgres.address import parse

it = Carrier(parse(sys.argv[1]), sys.argv[2])
while True:
    select.select([it.fileno()], [], [])
    for each in it.take():
        print(each.payload.decode(), each.waited, each.at, flush=True)
"""


@pytest.fixture
def small_queue(postgres: PostgresServer) -> Iterator[None]:
    """Let the server's queue of notifications be as small as it can be; begin again with it."""
    postgres.execute(f"ALTER SYSTEM SET max_notify_queue_pages = {QUEUE_PAGES}")
    postgres.stop()
    postgres.start()
    yield
    postgres.execute("ALTER SYSTEM RESET max_notify_queue_pages")
    postgres.stop()
    postgres.start()


def notify_until_full(connection: Any) -> None:
    for _ in range(QUEUE_PAGES + 1):
        connection.execute("SELECT pg_notify('somebody', repeat('x', 7900))")


@contextmanager
def receiver(url: str, name: str, folder: Path) -> Iterator[Process]:
    """Run a process that prints what arrives, each with how long it waited, and when."""
    with process("-c", RECEIVER, url, name, folder=folder, name=name) as it:
        yield it


def cut_off(connection: Any, name: str) -> None:
    """End the session of a carrier."""
    query = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = %s"
    found = connection.execute(f"{query} AND datname = current_database()", (mail_of(name),))
    assert found.fetchall() == [(True,)]


def mail_of(name: str) -> str:
    return f"mav-tasks gateway {name} mail"


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


def test_a_recording_of_what_a_gateway_said_is_refused(postgres: PostgresServer) -> None:
    """By a role that may read the secret's table, too: it needs no key to repeat a notification."""
    url = postgres.new_database()
    with carriers(url, "a", "b") as (a, b), connected(url) as stranger:
        secret, fleet = stranger.execute(
            "SELECT secret, fleet FROM gateway_secret, meta"
        ).fetchone()
        channel = Seal(secret.encode(), fleet).channel("b")
        stranger.execute(f"LISTEN {channel}")
        a.send("b", b"drive")
        assert [each.payload for each in taken(b, bool)] == [b"drive"]
        recorded = [each.payload for each in stranger.notifies(timeout=LIMIT, stop_after=2)]
        stranger.execute(f"UNLISTEN {channel}")

        def repeat() -> None:
            refused = b.counts.refused
            for text in recorded:
                stranger.execute("SELECT pg_notify(%s, %s)", (channel, text))
            wait_until(lambda: b.counts.refused >= refused + len(recorded), within=LIMIT)

        repeat()
        a.close()  # nothing of it shows b any more how far it has counted
        cut_off(stranger, "b")
        wait_until(lambda: Trouble(None) in b.take(), within=LIMIT)
        repeat()
        assert b.take() == []


def test_a_stop_arrives_though_the_receiver_has_lost_its_connection(
    postgres: PostgresServer,
) -> None:
    """The sender does not know that nobody listens, and sends it once."""
    url = postgres.new_database()
    with carriers(url, "a", "b") as (a, b), connected(url) as operator:
        cut_off(operator, "b")
        a.send("b", b"stop", first=True, until=boot_time() + LIMIT)
        assert [each.payload for each in taken(b, bool)] == [b"stop"]


def test_while_the_database_is_away_few_wait_and_stops_are_not_dropped(
    postgres: PostgresServer,
) -> None:
    with carriers(postgres.new_database(), "a", "b") as (a, b):
        postgres.stop()
        wait_until(lambda: any(isinstance(each, Trouble) for each in a.take()), within=LIMIT)
        until = boot_time() + 2 * LIMIT
        a.send("b", b"stop", first=True, until=until)
        for number in range(OUTBOX + 500):
            a.send("b", b"%d" % number, until=until)
        assert a.counts.dropped == 500
        postgres.start()
        found = [each.payload for each in taken(b, lambda found: len(found) > OUTBOX)]
        assert found == [b"stop", *(b"%d" % number for number in range(500, OUTBOX + 500))]


def test_a_full_queue_of_the_server_is_told_once_and_used_again_when_there_is_room(
    postgres: PostgresServer, small_queue: None
) -> None:
    """A program that listens in a transaction keeps PostgreSQL from emptying it."""
    url = postgres.new_database()
    with carriers(url, "a", "b") as (a, b):
        with connected(url) as sleeper, connected(url) as filler:
            sleeper.execute("LISTEN x")
            sleeper.execute("BEGIN")
            sleeper.execute("SELECT 1")
            with pytest.raises(psycopg.errors.ProgramLimitExceeded):
                notify_until_full(filler)
            fd = a.fileno()
            assert fd is not None
            select.select([fd], [], [], LIMIT)
            told = a.take()
            a.send("b", b"stop", first=True, until=boot_time() + LIMIT)
            retried_at = boot_time() + 3 * RETRY
            wait_until(lambda: boot_time() > retried_at, within=LIMIT)
            told += a.take()
        assert [isinstance(each, Trouble) and each.words for each in told] == [FULL]
        assert [each.payload for each in taken(b, bool)] == [b"stop"]
        assert a.take() == [Trouble(None)]


def test_fleets_in_two_databases_of_a_server_do_not_meet(postgres: PostgresServer) -> None:
    with (
        carriers(postgres.new_database(), "a", "b") as (a, b),
        carriers(postgres.new_database(), "b", "c") as (other_b, c),
    ):
        a.send("", b"of the one", first=True)
        a.send("c", b"for nobody")
        c.send("", b"of the other", first=True)
        assert [each.payload for each in taken(b, bool)] == [b"of the one"]
        assert [each.payload for each in taken(other_b, bool)] == [b"of the other"]
        assert (a.peers, c.peers) == (frozenset({"b"}), frozenset({"b"}))
        assert a.take() + c.take() == []
        assert [it.counts.refused for it in (a, b, other_b, c)] == [0, 0, 0, 0]


def test_a_process_that_was_stopped_learns_how_late_it_reads(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    url = postgres.new_database()
    with carriers(url, "a") as (a,), receiver(url, "b", tmp_path) as b:
        wait_until(lambda: a.peers, within=LIMIT)
        os.kill(b.popen.pid, signal.SIGSTOP)
        sent_at = boot_time()
        a.send("b", b"telemetry")
        a.send("b", b"stop", first=True)
        a.send("b", b"kept", until=sent_at + LIMIT)
        wait_until(lambda: boot_time() > sent_at + 1.2, within=LIMIT)  # it could be first's end
        resumed_at = boot_time()
        os.kill(b.popen.pid, signal.SIGCONT)
        b.wait_for("kept")
        found = [line.split() for line in b.text.splitlines()]
        assert [payload for payload, _, _ in found] == ["stop", "kept"]
        for _, waited, at in found:  # one machine, one clock
            assert float(waited) >= float(at) - sent_at - 0.001
            assert float(waited) >= resumed_at - sent_at - 0.001


def test_too_long_a_datagram_and_a_bad_name_are_refused(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with pytest.raises(ValueError, match="up to 40 letters"):
        Carrier(parse(url), "a b")
    with carriers(url, "a", "b") as (a, _), pytest.raises(ValueError, match="401 bytes"):
        a.send("b", b"x" * 401)
