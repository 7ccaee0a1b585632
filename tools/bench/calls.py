"""Time of one call of the command line while the server and its rover are there."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from time import monotonic, perf_counter, sleep

from .child import END_WITHIN, udp_socket
from .start import ENVIRONMENT, MAV_TASKS
from .table import Row

REPEATS = 9
GIVE_UP = 10.0  # s until the rover is served
GOAL = 0.25  # s

CALLS = ("queue", "status 1", "vehicles", "submit wait 0.1", "history", "ready")


def measure() -> list[Row]:
    """Return a row for each call."""
    with _served() as url:
        python = _median(sys.executable, "-c", "pass")
        return [
            _row(call, _median(str(MAV_TASKS), *call.split(), "--server", url), python)
            for call in CALLS
        ]


def _row(call: str, seconds: float, python: float) -> Row:
    return Row(
        f"mav-tasks {call}",
        f"{seconds * 1e3:.0f} ms",
        f"{python * 1e3:.0f} ms python -c pass",
        f"{seconds / python:.1f}×",
        f"< {GOAL * 1e3:.0f} ms",
        seconds < GOAL,
    )


def _median(*command: str) -> float:
    times = []
    for _ in range(REPEATS + 1):
        begun = perf_counter()
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=ENVIRONMENT)
        times.append(perf_counter() - begun)
    return median(times[1:])  # the first one fills the cache of bytecode


@contextmanager
def _served() -> Iterator[str]:
    """Run a simulated rover and a server that has one task; give the server's URL."""
    with udp_socket() as one, udp_socket() as other:
        rover, client = (each.getsockname()[1] for each in (one, other))
    sim = [sys.executable, "-m", "rover_sim", "--body", "kinematic", "--port", str(rover)]
    serve = [str(MAV_TASKS), "serve", "--no-push", "--store=:memory:"]
    serve += [f"--client=udpin:127.0.0.1:{client}", f"--vehicle=udpout:127.0.0.1:{rover}"]
    url = f"udpout:127.0.0.1:{client}"
    running = [
        subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT
        )
        for command in (sim, serve)
    ]
    try:
        end = monotonic() + GIVE_UP
        first = [str(MAV_TASKS), "submit", "wait", "0.1", "--server", url]
        while subprocess.run(first, capture_output=True, check=False).returncode:
            if monotonic() > end:
                raise TimeoutError("the server did not take a task")
            sleep(0.1)
        yield url
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait(END_WITHIN)
