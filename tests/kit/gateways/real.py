"""Real gateways on a real PostgreSQL, each behind its own TCP proxy; what they move is judged."""

import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

from tests.kit.gateways import mover
from tests.kit.postgres import PostgresServer
from tests.kit.processes import START_LIMIT, STOP_LIMIT, environment_with, wait_until
from tests.kit.tcp_proxy import TcpProxy

RECENT = 0.2  # s; a vehicle with a line as new as that has a mover
SETTLED = 15.0  # s; the most until each vehicle has a mover, on a busy machine


@dataclass(frozen=True, slots=True)
class Motion:
    """A line of a gateway: it might move the vehicle at a moment between two times."""

    before: float  # s of CLOCK_MONOTONIC
    after: float
    epoch: int
    name: str
    pid: int
    vehicle: int


class Gateway:
    """A gateway's process. ``label`` keeps it apart from another one of its name."""

    def __init__(self, name: str, url: str, lines: Path, vehicles: range, *, label: str) -> None:
        self.name = name
        self._output = lines.with_name(f"{label}.log")
        command = [sys.executable, "-m", mover.__name__, url, name, str(lines)]
        with self._output.open("ab") as sink:
            self._process = subprocess.Popen(
                [*command, *map(str, vehicles)],
                stdin=subprocess.PIPE,
                stdout=sink,
                stderr=subprocess.STDOUT,
                cwd=Path(__file__).resolve().parents[3],
                env=environment_with(),
            )
        self.pid = self._process.pid

    def __repr__(self) -> str:
        return f"Gateway({self.name}, {self.pid})"

    def has_begun(self) -> bool:
        """Return whether it keeps a lease, or has ended."""
        return self._process.poll() is not None or "begun\n" in self.text

    @property
    def text(self) -> str:
        """What it has said."""
        return self._output.read_text(encoding="utf-8")

    def is_running(self) -> bool:
        """Return whether the process has not ended."""
        return self._process.poll() is None

    def send(self, number: signal.Signals) -> None:
        """Send a signal."""
        self._process.send_signal(number)

    def say(self, command: str) -> None:
        """Write a line to its standard input."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{command}\n".encode())
        self._process.stdin.flush()

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait(STOP_LIMIT)
        assert self._process.stdin is not None
        self._process.stdin.close()


@dataclass
class Fleet:
    """Gateways that all hear the same vehicles."""

    server: PostgresServer
    url: str
    lines: Path
    vehicles: range
    proxies: Mapping[str, TcpProxy]
    gateways: dict[str, Gateway] = field(default_factory=dict)
    _read: int = 0  # bytes of the lines
    motions: list[Motion] = field(default_factory=list)
    _started: int = 0

    def start(self, name: str) -> Gateway:
        """Start a gateway, without waiting for it."""
        self._started += 1
        port = self.proxies[name].port
        url = self.url.replace(f":{self.server.port}/", f":{port}/")
        label = f"{name}-{self._started}"
        return Gateway(name, url, self.lines, self.vehicles, label=label)

    def again(self, name: str) -> None:
        """Start a gateway whose process has ended."""
        self.gateways[name] = self.start(name)

    def end(self) -> None:
        """End all processes."""
        for each in self.gateways.values():
            each.kill()

    def read(self) -> list[Motion]:
        """Return all motions so far."""
        with self.lines.open("rb") as file:
            file.seek(self._read)
            data = file.read()
        whole = data[: data.rfind(b"\n") + 1]
        self._read += len(whole)
        for line in whole.decode().splitlines():
            before, after, epoch, name, pid, vehicle = line.split()
            self.motions.append(
                Motion(float(before), float(after), int(epoch), name, int(pid), int(vehicle))
            )
        return self.motions

    def movers(self, *, since: float) -> dict[int, Motion]:
        """Return the latest motion of each vehicle, if it is not older than ``since``."""
        found: dict[int, Motion] = {}
        for each in reversed(self.read()):
            if each.before < since - 1.0:
                break
            if each.before >= since and each.vehicle not in found:
                found[each.vehicle] = each
        return found

    def settle(self) -> dict[int, Motion]:
        """Wait until each vehicle is moved; return the latest motions."""

        def moved() -> dict[int, Motion] | None:
            found = self.movers(since=time.monotonic() - RECENT)
            return found if len(found) == len(self.vehicles) else None

        return wait_until(moved, within=SETTLED, what=self.said)

    def taken_from(self, gateway: Gateway, *, since: float) -> dict[int, float]:
        """Wait until others move all that a gateway moved shortly before; return how long it took.

        By vehicle, in seconds from ``since`` to the first motion by another one.
        """
        its = {
            each.vehicle
            for each in self.read()
            if each.pid == gateway.pid and since - RECENT < each.before <= since
        }
        first: dict[int, float] = {}

        def all_taken() -> bool:
            for each in self.read():
                if each.before > since and each.pid != gateway.pid and each.vehicle in its:
                    first.setdefault(each.vehicle, each.before - since)
            return len(first) == len(its)

        wait_until(all_taken, within=SETTLED, what=self.said)
        return first

    def said(self) -> str:
        """Return what all have said last."""
        return "\n".join(f"{it}: {it.text[-1500:]}" for it in self.gateways.values())


def overlaps(motions: list[Motion]) -> list[str]:
    """Return where two leases moved one vehicle in turns, or at one time: each must be one span."""
    spans: dict[int, dict[int, tuple[float, float]]] = defaultdict(dict)
    for each in motions:
        begin, end = spans[each.vehicle].get(each.epoch, (each.after, each.before))
        span = min(begin, each.after), max(end, each.before)
        spans[each.vehicle][each.epoch] = span
    return [
        f"vehicle {vehicle}: epoch {one} at {a} and epoch {other} at {b}"
        for vehicle, by_epoch in spans.items()
        for (one, a), (other, b) in combinations(sorted(by_epoch.items()), 2)
        if a[0] < b[1] and b[0] < a[1]
    ]


@contextmanager
def fleet(server: PostgresServer, folder: Path, names: str, vehicles: range) -> Iterator[Fleet]:
    """Run gateways for a ``with`` block; all hear the same vehicles."""
    lines = folder / "motions"
    lines.touch()
    with ExitStack() as ends:
        proxies = {name: ends.enter_context(closing(TcpProxy(server.port))) for name in names}
        it = Fleet(server, server.new_database(), lines, vehicles, proxies)
        ends.callback(it.end)
        for name in names:
            it.again(name)
        for each in it.gateways.values():
            wait_until(each.has_begun, within=START_LIMIT, what=it.said)
        it.settle()
        yield it
