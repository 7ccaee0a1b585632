"""Modules as processes, in real time: for the demo, and for code under test with sockets."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rover_sim.testing.options import RoverOptions

T = TypeVar("T")

START_LIMIT = 20.0  # s, for a process to report its start, on a busy machine
STOP_LIMIT = 5.0  # s, for a process to end after SIGTERM
LOOK = 0.05  # s
#: how a process ends after Ctrl-C, which a terminal sends to all of them
INTERRUPTED = (130, -signal.SIGINT)
#: and if SIGTERM comes while it is already ending after Ctrl-C
ENDED = (0, *INTERRUPTED, -signal.SIGTERM)
SETTINGS = "MAV_TASKS_"  # the user's environment settings must not affect the test
LAST_LINES = 10  # of each process, shown with a failing test


class ProcessFailed(Exception):
    """A process does not do what it should; the message has the reason."""


@dataclass
class Process:
    """A running process, and its log."""

    name: str
    popen: subprocess.Popen[bytes]
    log: Path

    @property
    def text(self) -> str:
        """Its output so far."""
        return self.log.read_text("utf-8", "replace")

    def check(self) -> None:
        """Raise ProcessFailed, with its last line, if it has ended by itself."""
        code = self.popen.poll()
        if code is not None and code not in INTERRUPTED:
            said = self.text.strip() or "no output"
            last = said.splitlines()[-1]
            raise ProcessFailed(f"{self.name} ended early, exit code {code}: {last}")

    def said(self, pattern: str, *, within: float = START_LIMIT) -> re.Match[str]:
        """Return the first match in what it says. Raise ProcessFailed if none comes in time."""

        def found() -> re.Match[str] | None:
            self.check()
            return re.search(pattern, self.text)

        return until(found, within=within, what=f"{self.name} to start")

    def kill(self) -> None:
        """End it as a crash would."""
        self.popen.kill()
        self.popen.wait()


@contextmanager
def module(
    name: str,
    text: str,
    *more: str,
    folder: Path,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
) -> Iterator[Process]:
    """Run a Python module for a ``with`` block; then end it with SIGTERM.

    ``text``: its arguments, up to those that may have blanks. ``folder`` is that of its log. Raise
    ProcessFailed if it has not ended well.
    """
    label = f"{name} {text.split(maxsplit=1)[0]}"
    log = folder / f"{len(list(folder.glob('*.log')))}.log"
    command = [sys.executable, "-m", name, *text.split(), *more]
    with log.open("wb") as output:
        running = subprocess.Popen(
            command, stdout=output, stderr=subprocess.STDOUT, cwd=cwd, env=env
        )
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
        raise ProcessFailed(f"{label} ended with {running.returncode}")


def until(condition: Callable[[], T | None], *, within: float, what: str) -> T:
    """Wait until something is there, and return it. Raise ProcessFailed if it does not come."""
    end = time.monotonic() + within
    while not (found := condition()):
        if time.monotonic() > end:
            raise ProcessFailed(f"waited {within:.0f} s for {what}")
        time.sleep(LOOK)
    return found


def free_ports(count: int) -> list[int]:
    """Return free UDP ports of the loopback."""
    with ExitStack() as stack:
        sockets = [
            stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            for _ in range(count)
        ]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [int(each.getsockname()[1]) for each in sockets]


class RealTime:
    """The processes of the fixtures ``rover_url`` and ``server_url``, until ``close``."""

    def __init__(self, options: RoverOptions, *, seed: int, folder: Path) -> None:
        self._options = options
        self._seed = seed
        self._folder = folder
        self._stack = ExitStack()
        self._processes: list[Process] = []

    def start_rovers(self) -> str:
        """Start the rovers; return their URL."""
        options = self._options
        text = f"--port=0 --peers=all --body={options.body} --persona={options.persona}"
        text += f" --frame={options.make.frame.value} --count={options.count} --seed={self._seed}"
        rovers = self._start("rover_sim", text)
        return "udpout:" + rovers.said(r"on udp (127\.0\.0\.1:\d+)")[1]

    def start_server(self, rover_url: str) -> str:
        """Start the server; return its URL once it has found every rover."""
        (port,) = free_ports(1)
        text = f"serve --config= --store=:memory: --client=udpin:127.0.0.1:{port} --no-push"
        # a PX4 rover would first have to be configured to stop when setpoints stop
        text += f" --vehicle={rover_url} --set=rules.loss_failsafe=accept"
        server = self._start("mav_tasks.cli", text)
        for number in range(1, self._options.count + 1):
            server.said(rf"rover {number}: found")
        return f"udpout:127.0.0.1:{port}"

    def describe(self) -> str:
        """Return the last output of the processes, for a failing test."""
        lines = [f"seed {self._seed} (the same again: --rover-seed {self._seed})"]
        for process in self._processes:
            name = process.name.partition(" ")[0]
            lines += [f"{name}:", *process.text.splitlines()[-LAST_LINES:]]
        return "\n".join(lines)

    def close(self) -> None:
        """End the processes, the last first."""
        with suppress(ProcessFailed):  # one may have ended as its test wanted
            self._stack.close()

    def _start(self, name: str, text: str) -> Process:
        env = {name: v for name, v in os.environ.items() if not name.startswith(SETTINGS)}
        folder = self._folder
        running = module(name, text, folder=folder, cwd=folder, env=env)
        process = self._stack.enter_context(running)
        self._processes.append(process)
        return process
