"""Evenness of 20 Hz setpoints: of one server with 1 to 240 rovers, and of gateways of a fleet."""

import json
import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from typing import NamedTuple

from tests.kit.processes import wait_until

from .processes import Process, cpu_seconds, database, server, simulated_rovers
from .rows import Percentiles, Row, percentiles
from .wire import STATION, Speaker, move

ROVERS = (1, 20, 100, 150, 240)  # MAVLink has system ids for no more
FLEETS = ((1, 20), (1, 100), (4, 25))  # gateways, and rovers of each
SECONDS = 10.0  # of driving
PERIOD = 0.05  # s between two setpoints
EACH = 0.003  # s between the submissions to two rovers


class Driven(NamedTuple):
    """Deviations of intervals from PERIOD, of all rovers and p99 of the worst; memory grown."""

    errors: Percentiles
    worst: float
    grown: int
    note: str


def measure(tree: Path) -> Iterator[Row]:
    """Deviation of the interval between 20 Hz setpoints from 50 ms, for 1 to 240 rovers."""
    for rovers in ROVERS:
        it = driven(tree, rovers)
        what = f"setpoint error, p99, {rovers} rovers"
        yield Row(what, it.errors.p99, "ms", goal="≤ 5 ms", note=it.note)


def fleets(tree: Path) -> Iterator[Row]:
    """The same for gateways, p99 of the worst rover; beside a server without a fleet."""
    for gateways, rovers in FLEETS:
        alone = driven(tree, gateways * rovers).worst
        it = driven(tree, rovers, gateways)
        what = f"setpoint error, worst p99 of a rover, {gateways} gateways, {rovers} rovers each"
        yield Row(what, it.worst, "ms", alone, "without a fleet", "≤ 5 ms", it.note)


def driven(
    tree: Path,
    rovers: int,
    gateways: int = 0,
    *,
    is_limited: bool = False,
    meanwhile: Callable[[int], AbstractContextManager[object]] = nullcontext,
) -> Driven:
    """Drive rovers by a server, or by each of some gateways; with ``meanwhile`` at its port."""
    with ExitStack() as stack:
        base = stack.enter_context(database()) if gateways else None
        store = f"--store={base.new_database() if base else ':memory:'}"
        servers: list[Process] = []
        for index in range(max(1, gateways)):
            first = 1 + index * rovers
            port = stack.enter_context(simulated_rovers(rovers, first=first))
            options = ["--arming=server", store, *([f"--gateway=g{index}"] if gateways else [])]
            running = server(tree, port, *options, is_timed=True, is_limited=is_limited)
            servers.append(stack.enter_context(running))
        for index, it in enumerate(servers):
            _drive(it, 1 + index * rovers, rovers)
        stack.enter_context(meanwhile(servers[0].port))
        pids = [it.popen.pid for it in servers], base.pids() if base else []
        memory, began = servers[0].memory(), time.monotonic()
        before = [cpu_seconds(*each) for each in pids]
        time.sleep(SECONDS)
        used, of_database = (
            (cpu_seconds(*each) - spent) / SECONDS for each, spent in zip(pids, before, strict=True)
        )
        grown = servers[0].memory() - memory
    errors: dict[float, list[float]] = defaultdict(list)
    for it in servers:
        for rover, at, interval in json.loads(it.said.splitlines()[-1]):
            if began <= at < began + SECONDS:
                errors[rover].append(abs(interval - PERIOD))
    worst = max((percentiles(each).p99 for each in errors.values()), default=math.inf)
    all_of_them = percentiles([error for each in errors.values() for error in each])
    note = f"p50 {all_of_them.p50 * 1e3:.2f} ms, {len(errors)} rovers,"
    note += f" {used / len(servers):.2f} cores each, database {of_database:.2f}"
    return Driven(all_of_them, worst, grown, note)


def _drive(it: Process, first: int, rovers: int) -> None:
    """Submit a long move to each rover, once all have sent a position."""
    wait_until(lambda: it.text.count(": found") >= rovers, within=20.0, what=f"{rovers} rovers")
    time.sleep(3.0)
    with Speaker(to=it.port) as client:
        client.send(STATION)
        for rover in range(first, first + rovers):
            client.send(move(rover, 100.0, rover=rover))
            time.sleep(EACH)
    time.sleep(2.0)  # they arm
