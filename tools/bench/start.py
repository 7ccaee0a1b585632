"""Time until the server serves, prints its help, or a script can begin."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import monotonic, perf_counter

from .child import END_WITHIN, udp_socket
from .scripted import ScriptedVehicle
from .table import Row

REPEATS = 5
GIVE_UP = 10.0  # s
MAV_TASKS = Path(sys.executable).with_name("mav-tasks")

#: in which Python caches bytecode, as in an installation
ENVIRONMENT = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}

GOAL_START = 1.0  # s
GOAL_HELP = 0.3  # s
GOAL_IMPORT = 0.15  # s, without the generated dialect

DIALECT = "import mav_tasks.mavlink._dialect"
LIBRARY = "from mav_tasks import Client, Move"


def measure() -> list[Row]:
    """Return the rows of start and help."""
    python = median(_run(sys.executable, "-c", "pass") for _ in range(REPEATS))
    start = median(_first_heartbeat() for _ in range(REPEATS))
    shown = median(_run(str(MAV_TASKS), "--help") for _ in range(REPEATS))
    dialect, library, name = (
        median(_run(sys.executable, "-c", code) for _ in range(REPEATS)) - python
        for code in (DIALECT, LIBRARY, "import mav_tasks")
    )
    return [
        _row("server start → first heartbeat", start, python, GOAL_START),
        _row("mav-tasks --help", shown, python, GOAL_HELP),
        _row("import mav_tasks", name, python, GOAL_IMPORT),
        _row(f"{LIBRARY}, but for the dialect", library - dialect, python, GOAL_IMPORT),
        _row(f"{LIBRARY}, all of it", library, python, None),
    ]


def _row(what: str, seconds: float, python: float, goal: float | None) -> Row:
    return Row(
        what,
        f"{seconds * 1e3:.0f} ms",
        f"{python * 1e3:.0f} ms python -c pass",
        f"{seconds / python:.1f}×",
        "–" if goal is None else f"< {goal * 1e3:.0f} ms",
        None if goal is None else seconds < goal,
    )


def _run(*command: str) -> float:
    """Return the seconds of a process; all but the first find cached bytecode."""
    start = perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=ENVIRONMENT)
    return perf_counter() - start


def _first_heartbeat() -> float:
    """Return the seconds from spawning the server to its first packet at a pushed client."""
    with udp_socket() as client, udp_socket() as vehicle_socket, udp_socket() as spare:
        vehicle = ScriptedVehicle(vehicle_socket)
        listen, push, dial = (s.getsockname()[1] for s in (spare, client, vehicle_socket))
        spare.close()
        start = perf_counter()
        process = subprocess.Popen(
            [
                str(MAV_TASKS),
                "serve",
                f"--client=udpin:127.0.0.1:{listen}",
                f"--push=127.0.0.1:{push}",
                f"--vehicle=udpout:127.0.0.1:{dial}",
                "--store=:memory:",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=ENVIRONMENT,
        )
        try:
            end = monotonic() + GIVE_UP
            while monotonic() < end:
                ready, _, _ = select.select([client, vehicle_socket], [], [], GIVE_UP)
                if client in ready:
                    return perf_counter() - start
                vehicle.answer(wait=0.1)
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(END_WITHIN)
    return float("inf")
