"""Missions uploaded by the real MAVSDK, to the server and to MAVSDK's own mission server.

The server has its store on the disk and a simulated rover; MAVSDK's keeps missions in memory and
has no other work. Both figures include the client's own cost.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import quantiles
from tempfile import TemporaryDirectory

from .child import HOST, ROOT, child, free_port, simulated_rovers
from .table import Row

GIVE_UP = 180.0  # s
GOAL = 2.0  # times MAVSDK's own


def measure(profile: str | None = None) -> list[Row]:
    """Return two rows per number of items; each upload is acknowledged once it is durable."""
    port, vehicle_port, mavsdk_port = free_port(), free_port(), free_port()
    url, mavsdk_url = f"udpout://{HOST}:{port}", f"udpout://{HOST}:{mavsdk_port}"
    with TemporaryDirectory(dir=Path.cwd()) as folder:  # the project's disk
        options = ["--store", str(Path(folder) / "tasks.sqlite3")]
        options += [] if profile is None else ["--profile", profile]
        with (
            child("mavsdk_ends", "vehicle", str(mavsdk_port)),
            simulated_rovers(1, vehicle_port),
            child("server", str(port), str(vehicle_port), *options, quiet=True),
        ):
            client = [sys.executable, "-m", "tools.bench.mavsdk_ends", "client", url, mavsdk_url]
            said = subprocess.run(
                client, cwd=ROOT, stdout=subprocess.PIPE, check=True, timeout=GIVE_UP
            ).stdout
    times: dict[str, dict[str, list[float]]] = json.loads(said)
    return [
        row
        for count, ours in times[url].items()
        for row in _rows(count, ours, times[mavsdk_url][count])
    ]


def _rows(count: str, ours: Sequence[float], theirs: Sequence[float]) -> list[Row]:
    mine, yours = quantiles(ours, n=10), quantiles(theirs, n=10)
    return [
        _row(f"upload of {count} items → durable ack, p50", mine[4], yours[4], goal=GOAL),
        _row(f"upload of {count} items → durable ack, p90", mine[8], yours[8], goal=None),
    ]


def _row(what: str, ours: float, theirs: float, *, goal: float | None) -> Row:
    return Row(
        what,
        f"{ours * 1e3:.1f} ms",
        f"{theirs * 1e3:.1f} ms MAVSDK's server",
        f"{ours / theirs:.1f}×",
        "" if goal is None else f"≤ {goal:.0f}×",
        None if goal is None else ours <= goal * theirs,
    )
