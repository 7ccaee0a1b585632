"""Servers that are killed, and a database that fails in every way, at random; seeds are printed."""

import random
import signal
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from subprocess import Popen
from typing import Any

import pytest

from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until
from tests.kit.tcp_proxy import TcpProxy
from tests.kit.volume import tries
from tests.unit.store.test_failures import child, line

SEEDS = tries(1, long=10)  # half a minute each
LIVES = tries(2, long=4)
MOST_FAULTS = 5  # in a life
MOST_LINES = 60  # that a server says between two faults
AT_LEAST = 20  # events kept after the last fault


class Life:
    """A server that writes, and what it has said to be kept."""

    def __init__(self, process: "Popen[str]", kept: int) -> None:
        self._process = process
        self.kept = kept

    def read(self) -> bool:
        """Read a line; return whether it tells a failure."""
        word, _, rest = line(self._process).partition(" ")
        assert word, "the server has ended"
        if word == "kept":
            assert int(rest) > self.kept
            self.kept = int(rest)
        return word != "kept"

    def until_failure(self) -> None:
        """Read until a failure is told."""
        while not self.read():
            pass

    def until_kept(self, number: int) -> None:
        """Read until so many are kept."""
        while self.kept < number:
            self.read()

    def die(self) -> None:
        """Kill the server, and read what it had said."""
        self._process.send_signal(signal.SIGKILL)
        self._process.wait(10)
        assert self._process.stdout is not None
        for rest in self._process.stdout:
            if rest.startswith("kept ") and rest.endswith("\n"):
                self.kept = int(rest.split()[1])


def killed(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    server.kill()
    life.until_failure()
    server.start()


def stopped(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    server.stop()
    life.until_failure()
    server.start()


def frozen(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    with server.frozen():
        life.until_failure()


def frozen_for_a_moment(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    with server.frozen():
        pass


def silent(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    proxy.fall_silent()


def refused(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    with proxy.refusing():
        life.until_failure()


def locked(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    with connected(url) as other:
        other.execute("BEGIN")
        other.execute("LOCK TABLE tasks IN ACCESS EXCLUSIVE MODE")
        life.until_failure()
        other.execute("ROLLBACK")


def ended(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    signal_sessions(server, "pg_terminate_backend", url)


def cancelled(server: PostgresServer, proxy: TcpProxy, url: str, life: Life) -> None:
    signal_sessions(server, "pg_cancel_backend", url)


def signal_sessions(server: PostgresServer, function: str, url: str) -> None:
    server.execute(
        f"SELECT {function}(pid) FROM pg_stat_activity"
        " WHERE datname = %s AND application_name = 'mav-tasks serve'",
        (url.rpartition("/")[2],),
    )


FAULTS: list[Callable[[PostgresServer, TcpProxy, str, Life], None]] = [
    killed,
    stopped,
    frozen,
    frozen_for_a_moment,
    silent,
    refused,
    locked,
    ended,
    cancelled,
]


def await_end(tables: Any) -> None:
    """Wait until the database has ended a killed server's sessions: the next one waits 1 s only."""
    query = (
        "SELECT count(*) FROM pg_stat_activity"
        " WHERE datname = current_database() AND application_name = 'mav-tasks serve'"
    )
    wait_until(lambda: tables.execute(query).fetchone() == (0,), within=20, what="no session")


@contextmanager
def proxied(server: PostgresServer, url: str) -> Iterator[tuple[TcpProxy, str]]:
    with closing(TcpProxy(server.port)) as proxy:
        yield proxy, url.replace(f":{server.port}/", f":{proxy.port}/")


@pytest.mark.slow
@pytest.mark.volume
@pytest.mark.timeout(600)
@pytest.mark.parametrize("seed", range(SEEDS))
def test_nothing_that_was_kept_is_lost_and_nothing_is_there_twice(
    postgres: PostgresServer, seed: int
) -> None:
    chance = random.Random(seed)
    url = postgres.new_database()
    kept = 0
    with proxied(postgres, url) as (proxy, by_proxy):
        for _ in range(LIVES):
            with child(by_proxy) as process:
                life = Life(process, kept)
                for _ in range(chance.randint(1, MOST_FAULTS)):
                    for _ in range(chance.randint(0, MOST_LINES)):
                        life.read()
                    fault = chance.choice(FAULTS)
                    print(f"seed {seed}: {fault.__name__} after {life.kept}")
                    fault(postgres, proxy, url, life)
                life.until_kept(life.kept + AT_LEAST)
                life.die()
            with connected(url) as tables:
                await_end(tables)
                found = tables.execute("SELECT id, number FROM tasks ORDER BY id").fetchall()
            assert [each[0] for each in found] == list(range(1, len(found) + 1))
            assert len({each[1] for each in found}) == len(found)
            assert len(found) >= life.kept
            kept = len(found)
