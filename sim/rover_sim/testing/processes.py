"""Rovers and a task server as processes, in real time: for code that opens its own socket."""

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rover_sim.testing.options import RoverOptions

START_LIMIT = 20.0  # s, for a process to report its start, on a busy machine
STOP_LIMIT = 5.0  # s, for a process to end after SIGTERM
LOOK = 0.02  # s between two reads of its output
SETTINGS = "MAV_TASKS_"  # the user's environment settings must not affect the test
LAST_LINES = 10  # of each process, shown with a failing test


class ProcessFailed(Exception):
    """A process did not start; the message has its output."""


class OwnProcess:
    """A module run as a process; it is ended by its own id."""

    def __init__(self, module: str, arguments: Sequence[str], folder: Path) -> None:
        self.name = module
        self._output = folder / f"{module}.log"
        with self._output.open("wb") as sink:
            self._popen = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                stdout=sink,
                stderr=subprocess.STDOUT,
                cwd=folder,
                env={name: v for name, v in os.environ.items() if not name.startswith(SETTINGS)},
            )

    def end(self) -> None:
        """End it."""
        self._popen.terminate()
        try:
            self._popen.wait(STOP_LIMIT)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            self._popen.wait()

    @property
    def text(self) -> str:
        """Its output so far."""
        return self._output.read_text(encoding="utf-8", errors="replace")

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Wait until the output matches, and return the match. Raise ProcessFailed."""
        end = time.monotonic() + START_LIMIT
        while True:
            is_over = self._popen.poll() is not None
            if (found := re.search(pattern, self.text)) is not None:
                return found
            if is_over or time.monotonic() > end:
                how = "ended" if is_over else f"did not say {pattern!r} in {START_LIMIT:g} s"
                raise ProcessFailed(f"{self.name} {how}:\n{self.text}")
            time.sleep(LOOK)


class RealTime:
    """The processes of the fixtures ``rover_url`` and ``server_url``, until ``close``."""

    def __init__(self, options: RoverOptions, *, seed: int, folder: Path) -> None:
        self._options = options
        self._seed = seed
        self._folder = folder
        self._stack = ExitStack()
        self._processes: list[OwnProcess] = []

    def start_rovers(self) -> str:
        """Start the rovers; return their URL."""
        options = self._options
        chosen = {
            "port": 0,
            "body": options.body,
            "persona": options.persona,
            "frame": options.make.frame.value,
            "count": options.count,
            "seed": self._seed,
        }
        rovers = self._start("rover_sim", *(f"--{name}={value}" for name, value in chosen.items()))
        port = rovers.wait_for(r"on udp 127\.0\.0\.1:(\d+)")[1]
        return f"udpout:127.0.0.1:{port}"

    def start_server(self, rover_url: str) -> str:
        """Start the server; return its URL once it has found every rover."""
        port = _free_udp_port()
        own = ("--config=", "--store=:memory:", f"--client=udpin:127.0.0.1:{port}", "--no-push")
        # a PX4 rover would first have to be configured to stop when setpoints stop
        more = (f"--vehicle={rover_url}", "--set=rules.loss_failsafe=accept")
        server = self._start("mav_tasks.cli", "serve", *own, *more)
        for number in range(1, self._options.count + 1):
            server.wait_for(rf"rover {number}: found")
        return f"udpout:127.0.0.1:{port}"

    def describe(self) -> str:
        """Return the last output of the processes, for a failing test."""
        lines = [f"seed {self._seed} (the same again: --rover-seed {self._seed})"]
        for process in self._processes:
            lines += [f"{process.name}:", *process.text.splitlines()[-LAST_LINES:]]
        return "\n".join(lines)

    def close(self) -> None:
        """End the processes, the last first."""
        self._stack.close()

    def _start(self, module: str, *arguments: str) -> OwnProcess:
        process = OwnProcess(module, arguments, self._folder)
        self._stack.callback(process.end)
        self._processes.append(process)
        return process


def _free_udp_port() -> int:
    """Return a free port of the loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
