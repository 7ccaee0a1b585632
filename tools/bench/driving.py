"""Evenness of 20 Hz setpoints with 1 to 240 rovers driven by one server."""

import time
from collections.abc import Iterator
from pathlib import Path

from .processes import Process, server, simulated_rovers
from .rows import Row, percentiles
from .wire import STATION, Speaker, move

ROVERS = (1, 20, 100, 150, 240)  # MAVLink has system ids for no more
SECONDS = 10.0  # of driving
EACH = 0.003  # s between the submissions to two rovers


def measure(tree: Path) -> Iterator[Row]:
    """Deviation of the interval between 20 Hz setpoints from 50 ms, for 1 to 240 rovers."""
    for rovers in ROVERS:
        with (
            simulated_rovers(rovers) as port,
            server(tree, port, "--arming=server", is_timed=True) as it,
        ):
            drive(it, rovers)
            time.sleep(SECONDS)
        errors = percentiles([error for _, _, error in it.results()])
        note = f"p50 {errors.p50 * 1e3:.2f} ms, {len(it.results()):,} intervals"
        what = f"setpoint interval error, p99, {rovers} rovers"
        yield Row(what, errors.p99, "ms", goal="≤ 5 ms", note=note)


def drive(it: Process, rovers: int, *, first: int = 1) -> None:
    """Submit a long move to each rover, once all have sent a position."""
    it.wait_for(r"rover \d+: found", count=rovers)
    time.sleep(3.0)
    with Speaker(to=it.port) as client:
        client.send(STATION)
        for rover in range(first, first + rovers):
            client.send(move(rover, 100.0, rover=rover))
            time.sleep(EACH)
    time.sleep(2.0)  # they arm
