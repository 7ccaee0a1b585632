"""Evenness of 20 Hz setpoints: of one server with 1 to 240 rovers, and of gateways of a fleet."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from .processes import Process, cpu_seconds, database, server, simulated_rovers
from .rows import Row, percentiles
from .wire import STATION, Speaker, move

ROVERS = (1, 20, 100, 150, 240)  # MAVLink has system ids for no more
FLEETS = ((1, 20), (1, 100), (4, 25))  # gateways, and rovers of each
SECONDS = 10.0  # of driving
EACH = 0.003  # s between the submissions to two rovers


def measure(tree: Path) -> Iterator[Row]:
    """Deviation of the interval between 20 Hz setpoints from 50 ms, for 1 to 240 rovers."""
    for rovers in ROVERS:
        _, error, note = _driven(tree, 0, rovers)
        yield Row(f"setpoint error, p99, {rovers} rovers", error, "ms", None, "", "≤ 5 ms", note)


def fleets(tree: Path) -> Iterator[Row]:
    """The same for gateways, p99 of the worst rover; beside a server without a fleet."""
    for gateways, rovers in FLEETS:
        alone, _, _ = _driven(tree, 0, gateways * rovers)
        worst, _, note = _driven(tree, gateways, rovers)
        what = f"setpoint error, worst p99 of a rover, {gateways} gateways, {rovers} rovers each"
        yield Row(what, worst, "ms", alone, "without a fleet", "≤ 5 ms", note)


def _driven(tree: Path, gateways: int, rovers: int) -> tuple[float, float, str]:
    """Return p99 of the worst rover, p99 of all, and what else there is to say."""
    with ExitStack() as stack:
        base = stack.enter_context(database()) if gateways else None
        store = f"--store={base.new_database() if base else ':memory:'}"
        servers: list[Process] = []
        for index in range(max(1, gateways)):
            port = stack.enter_context(simulated_rovers(rovers, first=1 + index * rovers))
            options = ["--arming=server", store, *([f"--gateway=g{index}"] if gateways else [])]
            servers.append(stack.enter_context(server(tree, port, *options, is_timed=True)))
        for index, it in enumerate(servers):
            drive(it, rovers, first=1 + index * rovers)
        pids = [it.pid for it in servers], base.pids() if base else []
        before, began = [cpu_seconds(*each) for each in pids], time.monotonic()
        time.sleep(SECONDS)
        used, of_database = (
            (cpu_seconds(*each) - spent) / SECONDS for each, spent in zip(pids, before, strict=True)
        )
    errors: dict[float, list[float]] = {}
    for it in servers:
        for rover, at, error in it.results():
            if began <= at < began + SECONDS:
                errors.setdefault(rover, []).append(error)
    worst = max((percentiles(each).p99 for each in errors.values()), default=math.inf)
    all_of_them = percentiles([error for each in errors.values() for error in each])
    note = f"p50 {all_of_them.p50 * 1e3:.2f} ms, {len(errors)} rovers,"
    note += f" {used / len(servers):.2f} cores each, database {of_database:.2f}"
    return worst, all_of_them.p99, note


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
