"""The processes of the demonstration: started, watched, and ended."""

import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

STOP_LIMIT = 5.0  # s, for a process to end after SIGTERM
LOOK = 0.1  # s
#: how a process ends after Ctrl-C, which a terminal sends to all of them
INTERRUPTED = (130, -signal.SIGINT)
#: and if SIGTERM comes while it is already ending after Ctrl-C
ENDED = (0, *INTERRUPTED, -signal.SIGTERM)


class DemoError(Exception):
    """The demonstration could not be run; the message has the reason."""


@dataclass
class Process:
    """A running process, and its log."""

    name: str
    popen: subprocess.Popen[bytes]
    log: Path

    def check(self) -> None:
        """Raise DemoError, with its last line, if it has ended by itself."""
        code = self.popen.poll()
        if code is not None and code not in INTERRUPTED:
            said = self.log.read_text("utf-8", "replace").strip() or "no output"
            raise DemoError(f"{self.name} ended early, exit code {code}: {said.splitlines()[-1]}")

    def said(self, pattern: str, *, within: float) -> re.Match[str]:
        """Return the first match in what it says. Raise DemoError if none comes in time."""

        def found() -> re.Match[str] | None:
            self.check()
            return re.search(pattern, self.log.read_text("utf-8", "replace"))

        return until(found, within=within, what=f"{self.name} to start")

    def kill(self) -> None:
        """End it as a crash would."""
        self.popen.kill()
        self.popen.wait()


@contextmanager
def module(
    name: str, text: str, *more: str, folder: Path, env: Mapping[str, str] | None = None
) -> Iterator[Process]:
    """Run a Python module for a ``with`` block; then end it with SIGTERM.

    ``text``: its arguments, up to those that may have blanks.
    """
    label = f"{name} {text.split(maxsplit=1)[0]}"
    log = folder / f"{len(list(folder.glob('*.log')))}.log"
    command = [sys.executable, "-m", name, *text.split(), *more]
    with log.open("wb") as output:
        running = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=env)
    try:
        yield Process(label, running, log)
    finally:
        is_killed = running.poll() == -signal.SIGKILL  # on purpose
        running.terminate()
        with suppress(subprocess.TimeoutExpired):
            running.wait(STOP_LIMIT)
        running.kill()
        running.wait()
    if running.returncode not in ENDED and not is_killed:
        raise DemoError(f"{label} ended with {running.returncode}")


def until(condition: Callable[[], T | None], *, within: float, what: str) -> T:
    """Wait until something is there, and return it. Raise DemoError if it does not come."""
    end = time.monotonic() + within
    while not (found := condition()):
        if time.monotonic() > end:
            raise DemoError(f"waited {within:.0f} s for {what}")
        time.sleep(LOOK)
    return found


def free_ports(count: int) -> list[int]:
    """Return free UDP ports of the loopback."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [int(each.getsockname()[1]) for each in sockets]
    finally:
        for each in sockets:
            each.close()
