"""Python processes that begin with our modules imported: forked from one that imports them once.

Each is a process of its own, with its own id, signals, files and memory. A third of a second of
processor time is saved each time, which is half of what most tests with processes need.
"""

import gc
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

#: what runs this way, and is imported before
PRELOADED = (
    "mav_tasks.cli.app",
    "mav_tasks.cli.serve",
    "mav_tasks.shell.serve",
    "rover_sim.__main__",
)
MODULES = ("mav_tasks.cli", "rover_sim")

#: what Python itself reads when it starts; a process that is to have other ones is not forked
_OWN = {name: value for name, value in os.environ.items() if name.startswith("PYTHON")}

_server = multiprocessing.get_context("forkserver")
_server.set_forkserver_preload(list(PRELOADED))


class Popen(Protocol):
    """The part of subprocess.Popen that tests use."""

    @property
    def pid(self) -> int:
        """The process id."""

    @property
    def returncode(self) -> int | None:
        """The exit status, negative for a signal; None until its end was noticed."""

    def poll(self) -> int | None:
        """Return the exit status, or None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; return the exit status. Raise subprocess.TimeoutExpired."""
        ...

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it has ended."""

    def kill(self) -> None:
        """Send SIGKILL, unless it has ended."""


def started(
    arguments: tuple[str, ...], *, python: str, output: Path, folder: Path, env: dict[str, str]
) -> Popen:
    """Run ``python`` with these arguments: forked if that is possible, else from nothing."""
    is_same = python == sys.executable and _OWN.items() == {
        (name, value) for name, value in env.items() if name.startswith("PYTHON")
    }
    if is_same and arguments[0] == "-m" and arguments[1] in MODULES:
        return Forked(arguments[1:], output=output, folder=folder, env=env)
    with output.open("wb") as sink:
        return subprocess.Popen(
            [python, *arguments], stdout=sink, stderr=subprocess.STDOUT, cwd=folder, env=env
        )


class Forked:
    """A forked process that runs a module as ``python -m`` does, with ``arguments``."""

    def __init__(
        self, arguments: tuple[str, ...], *, output: Path, folder: Path, env: dict[str, str]
    ) -> None:
        output.write_bytes(b"")  # here, so that nobody reads what an earlier one said
        run = Run(arguments, str(output), str(folder), env)
        self._process = _server.Process(target=run)
        self._process.start()
        assert self._process.pid is not None
        self.pid: int = self._process.pid

    @property
    def returncode(self) -> int | None:
        """The exit status, negative for a signal; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit status, or None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; return the exit status. Raise subprocess.TimeoutExpired."""
        self._process.join(timeout)
        status = self._process.exitcode
        if status is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        return status

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, sig)

    def kill(self) -> None:
        """Send SIGKILL, unless it has ended."""
        self.send_signal(signal.SIGKILL)


@dataclass(frozen=True)
class Run:
    """What a forked process does."""

    arguments: tuple[str, ...]  # a module's name, and its arguments
    output: str
    folder: str
    env: dict[str, str]

    def __call__(self) -> None:
        """Take up output, folder and environment, and run the module to its end."""
        sink = os.open(self.output, os.O_WRONLY | os.O_APPEND)
        os.dup2(sink, 1)
        os.dup2(sink, 2)
        os.close(sink)
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(  # noqa: SIM115
            2, "w", encoding="utf-8", errors="backslashreplace", buffering=1, closefd=False
        )
        os.chdir(self.folder)
        os.environ.clear()
        os.environ.update(self.env)
        sys.argv = list(self.arguments)
        gc.freeze()  # what was imported: to collect that would copy its pages, which takes long
        runpy.run_module(self.arguments[0], run_name="__main__", alter_sys=True)
