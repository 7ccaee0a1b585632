"""Evenness of 20 Hz setpoints of gateways on PostgreSQL: 20 and 100 rovers each, and four of them.

Real gateways, a database server and simulated rovers on one machine. The figures are those that the
gateways log when a STOP ends all tasks. The yardstick is a server without a fleet with the same
rovers. On a machine with few cores the simulated rovers take most of them.
"""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavState, MavType
from tests.kit.postgres import PostgresServer

from .carrier_result import cpu_seconds
from .child import END_WITHIN, ROOT, free_port, udp_socket
from .postgres import database_server
from .scripted import CLIENT, loopback
from .table import Row

#: number of gateways, and rovers of each; 0 gateways: a server without a fleet
SETS = ((0, 20), (1, 20), (0, 100), (1, 100), (4, 25))
DRIVING = 15.0  # s
FOUND_WITHIN = 60.0  # s, for all rovers to be held
GOAL = 5.0  # ms, as for a server without a fleet
EACH = 0.003  # s between two submissions
TIMED = re.compile(r"; (\d+) setpoints at 20 Hz: p50 ([\d.]+), p99 ([\d.]+), max ([\d.]+) ms")
FOUND = re.compile(r"rover (\d+): found")


@dataclass(frozen=True)
class _Figures:
    """Of the tasks of one run; times in ms, ``cpu`` in cores for each gateway."""

    tasks: int
    worst_p99: float
    longest: float
    cpu: float
    database: float


def measure() -> list[Row]:
    """Return a row for each set of gateways."""
    rows: list[Row] = []
    alone: dict[int, _Figures] = {}
    for gateways, each in SETS:
        found = _run(gateways, each)
        if not gateways:
            alone[each] = found
            continue
        rows.append(_row(gateways, each, found, alone.get(gateways * each) or alone[each]))
    return rows


def _row(gateways: int, each: int, found: _Figures, alone: _Figures) -> Row:
    many = "1 gateway" if gateways == 1 else f"{gateways} gateways"
    error = found.worst_p99 - 50.0
    return Row(
        f"{many}, {each} rovers each: worst p99 of a rover's setpoints, longest",
        f"{found.worst_p99:.1f} ms, {found.longest:.0f} ms ({found.tasks} rovers)",
        f"without a fleet {alone.worst_p99:.1f} ms, {alone.longest:.0f} ms",
        f"{found.cpu:.2f} cores a gateway, database {found.database:.2f}; alone {alone.cpu:.2f}",
        f"< {50 + GOAL:.0f} ms",
        error < GOAL,
    )


def _run(gateways: int, each: int) -> _Figures:
    with ExitStack() as opened:
        folder = Path(opened.enter_context(TemporaryDirectory(prefix="bench-gateways-")))
        store = ":memory:"
        database: PostgresServer | None = None
        if gateways:
            database = opened.enter_context(database_server())
            store = database.new_database()
        servers = [
            opened.enter_context(closing(_Server(folder, number, each, store, bool(gateways))))
            for number in range(max(1, gateways))
        ]
        end = monotonic() + FOUND_WITHIN
        while any(len(it.found()) < each for it in servers):
            if monotonic() > end:
                raise RuntimeError(f"only {[len(it.found()) for it in servers]} rovers found")
            sleep(0.2)
        sleep(4.0)  # positions come
        for it in servers:
            it.drive()
        before = [cpu_seconds(it.pid) for it in servers], _cpu_of(database)
        sleep(DRIVING)
        after = [cpu_seconds(it.pid) for it in servers], _cpu_of(database)
        servers[0].stop_all()
        sleep(3.0)
        timed = [values for it in servers for values in it.timed()]
    used = sum(after[0]) - sum(before[0])
    return _Figures(
        tasks=len(timed),
        worst_p99=max(p99 for p99, _ in timed),
        longest=max(longest for _, longest in timed),
        cpu=used / DRIVING / len(servers),
        database=(after[1] - before[1]) / DRIVING,
    )


class _Server:
    """A gateway, or a server without a fleet, with the rovers near it and a client."""

    def __init__(
        self, folder: Path, number: int, rovers: int, store: str, is_gateway: bool
    ) -> None:
        self._log = folder / f"{number}.log"
        self._rovers = range(1 + number * rovers, 1 + (number + 1) * rovers)
        vehicles, port = free_port(), free_port()
        simulator = [sys.executable, "-m", "rover_sim", "--body", "kinematic", "--boot", "none"]
        simulator += ["--count", str(rovers), "--system-id", str(self._rovers[0])]
        command = [sys.executable, "-m", "mav_tasks.cli", "serve", "--config", "", "--no-push"]
        command += ["--client", f"udpin:127.0.0.1:{port}", "--store", store]
        command += ["--vehicle", f"udpout:127.0.0.1:{vehicles}"]
        command += ["--gateway", f"g{number}"] if is_gateway else []
        data = {"XDG_DATA_HOME": str(folder), "XDG_STATE_HOME": str(folder)}
        self._processes = [_start([*simulator, "--port", str(vehicles)], folder / f"{number}.sim")]
        self._processes.append(_start(command, self._log, **data))
        self.pid = self._processes[-1].pid
        self._client, self._encoder = udp_socket(), Encoder(CLIENT)
        self._client.connect(loopback(port))

    def found(self) -> set[str]:
        """Return the rovers that it has met."""
        return set(FOUND.findall(self._log.read_text("utf-8", "replace")))

    def drive(self) -> None:
        """Submit a long move to each rover."""
        beat = m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
        self._client.send(self._encoder.encode(beat))
        for rover in self._rovers:
            move = m.CommandLong(rover, 191, MavCmd.TASK_MOVE, 0, 100.0, 0, 0, rover, 0, 0, 5)
            self._client.send(self._encoder.encode(move))
            sleep(EACH)

    def stop_all(self) -> None:
        """Stop the rovers of all gateways."""
        stop = m.CommandLong(0, 191, MavCmd.TASK_STOP, 0, 0, 0, 0, 0, 0, 0, 0)
        self._client.send(self._encoder.encode(stop))

    def timed(self) -> list[tuple[float, float]]:
        """Return p99 and the longest interval of each task, ms."""
        found = TIMED.findall(self._log.read_text("utf-8", "replace"))
        return [(float(p99), float(longest)) for _, _, p99, longest in found]

    def close(self) -> None:
        """End the processes."""
        self._client.close()
        for process in reversed(self._processes):
            process.send_signal(signal.SIGTERM)
        for process in self._processes:
            try:
                process.wait(END_WITHIN)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _start(command: Sequence[str], log: Path, **environment: str) -> subprocess.Popen[bytes]:
    with log.open("wb") as output:
        return subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, **environment},
        )


def _cpu_of(database: PostgresServer | None) -> float:
    """Return the processor time of a database server with its sessions, s; 0.0 without one."""
    return 0.0 if database is None else sum(map(cpu_seconds, database.pids()))
