"""Real servers as gateways of a fleet, each behind proxies that watch and cut its ways.

A tap between each gateway and the rover notes each packet that moves the rover; a watcher notes who
holds the rover in the database. No gateway may move what it does not hold.
"""

import selectors
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread
from typing import Any

from mav_tasks import SyncClient, TaskState
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import Process, free_udp_ports, process, wait_until
from tests.kit.tcp_proxy import TcpProxy

LOOK = 0.02  # s between two looks at who holds the rover
SLOP = 0.15  # s, by which a look may be late on a busy machine
SETPOINTS, COMMAND, ARM = (84, 86), 76, 400


def moves(data: bytes) -> bool:
    """Return whether a MAVLink 2 packet moves a rover, or arms it."""
    payload = data[10 : 10 + data[1]].ljust(60, b"\0")
    kind = int.from_bytes(data[7:10], "little")
    if kind in SETPOINTS:
        forward, side = struct.unpack_from("<2f", payload, 16)
        (turn,) = struct.unpack_from("<f", payload, 44)
        return any((forward, side, turn))
    if kind == COMMAND:
        (command,) = struct.unpack_from("<H", payload, 28)
        (first,) = struct.unpack_from("<f", payload)
        return bool(command == ARM and first == 1.0)
    return False


def is_zero(data: bytes) -> bool:
    """Return whether a MAVLink 2 packet is a set-point that stops a rover."""
    return int.from_bytes(data[7:10], "little") in SETPOINTS and not moves(data)


@dataclass(frozen=True, slots=True)
class Motion:
    """A packet of a gateway that moves or stops the rover, at a time of CLOCK_MONOTONIC."""

    at: float
    name: str


class Tap:
    """Forwards datagrams between one gateway and the rover, and notes those that move it."""

    def __init__(
        self, name: str, rover_port: int, motions: list[Motion], zeros: list[Motion]
    ) -> None:
        self._name, self._motions, self._zeros = name, motions, zeros
        self._front, self._back = (_socket() for _ in range(2))
        self._back.connect(("127.0.0.1", rover_port))
        self.port = int(self._front.getsockname()[1])
        self._gateway: Any = None
        self.is_cut = False
        self._over = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._front.close()
        self._back.close()

    def _run(self) -> None:
        with closing(selectors.DefaultSelector()) as selector:
            selector.register(self._front, selectors.EVENT_READ)
            selector.register(self._back, selectors.EVENT_READ)
            while not self._over.is_set():
                for key, _ in selector.select(LOOK):
                    with suppress(OSError):
                        self._pass_on(key.fileobj is self._front)

    def _pass_on(self, is_of_gateway: bool) -> None:
        if is_of_gateway:
            data, self._gateway = self._front.recvfrom(65_536)
            if moves(data):
                self._motions.append(Motion(time.monotonic(), self._name))
            elif is_zero(data):
                self._zeros.append(Motion(time.monotonic(), self._name))
            if not self.is_cut:
                self._back.send(data)
        else:
            data = self._back.recv(65_536)
            if self._gateway is not None and not self.is_cut:
                self._front.sendto(data, self._gateway)


class Watcher:
    """Notes who holds the rover, as the database has it."""

    QUERY = "SELECT name FROM holdings JOIN gateways ON gateway = gateways.number WHERE vehicle = 1"

    def __init__(self, url: str) -> None:
        self._url = url
        self.seen: list[tuple[float, float, str]] = []  # asked, answered, name; "" for nobody
        self._over = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def holder(self) -> str:
        """Return who held it last."""
        return self.seen[-1][2] if self.seen else ""

    def _run(self) -> None:
        import psycopg

        while not self._over.is_set():
            with suppress(psycopg.Error), connected(self._url) as connection:
                while not self._over.wait(LOOK):
                    asked = time.monotonic()
                    row = connection.execute(self.QUERY).fetchone()
                    self.seen.append((asked, time.monotonic(), row[0] if row else ""))
            self._over.wait(LOOK)


@dataclass
class Serving:
    """A rover, its gateways and their database."""

    server: PostgresServer
    folder: Path
    url: str
    ends: ExitStack
    rover_port: int
    motions: list[Motion] = field(default_factory=list)
    zeros: list[Motion] = field(default_factory=list)  # set-points that stop it
    processes: dict[str, Process] = field(default_factory=dict)
    clients: dict[str, int] = field(default_factory=dict)  # ports
    taps: dict[str, Tap] = field(default_factory=dict)
    proxies: dict[str, TcpProxy] = field(default_factory=dict)
    started: int = 0

    def start(self, name: str) -> Process:
        """Start a gateway, and wait until it has a lease."""
        self.started += 1
        url = self.url.replace(f":{self.server.port}/", f":{self.proxies[name].port}/")
        command = ["-m", "mav_tasks.cli", "serve", "--gateway", name, "--store", url]
        command += ["--client", f"udpin:127.0.0.1:{self.clients[name]}", "--no-push"]
        command += ["--vehicle", f"udpout:127.0.0.1:{self.taps[name].port}"]
        command += ["--set", "rules.loss_failsafe=accept", "--set", "rules.on_takeover=resume"]
        it = process(*command, folder=self.folder, name=f"{name}-{self.started}")
        self.processes[name] = self.ends.enter_context(it)
        self.processes[name].wait_for(f"as gateway {name} of its fleet", within=30)
        return self.processes[name]

    @contextmanager
    def client(self, name: str) -> Iterator[SyncClient]:
        """Return a client of a gateway."""
        with SyncClient(f"udpout:127.0.0.1:{self.clients[name]}", timeout=10) as it:
            yield it

    def states(self) -> dict[int, TaskState]:
        """Return the state of each stored task, by id."""
        with connected(self.url) as connection:
            rows = connection.execute("SELECT id, state FROM tasks").fetchall()
        return {number: TaskState(state) for number, state in rows}

    def said(self) -> str:
        """Return what all have said last."""
        return "\n".join(f"{name}: {it.text[-1500:]}" for name, it in self.processes.items())


def wrong_motions(motions: list[Motion], seen: list[tuple[float, float, str]]) -> list[str]:
    """Return the motions by gateways that did not hold the rover at that time, as far as seen."""
    found, first = [], 0
    for motion in motions:
        while first < len(seen) and seen[first][1] < motion.at - SLOP:
            first += 1
        near = []
        for asked, _, name in seen[max(0, first - 1) :]:
            near.append(name)
            if asked > motion.at + SLOP:
                break
        if near and motion.name not in near:
            found.append(f"{motion.at:.3f}: {motion.name} moves it, held by {sorted(set(near))}")
    return found


@contextmanager
def serving(server: PostgresServer, folder: Path, names: str) -> Iterator[Serving]:
    """Run gateways and a rover for a ``with`` block."""
    with ExitStack() as ends:
        (rover_port, *clients) = free_udp_ports(1 + len(names))
        rover = ["--port", str(rover_port), "--body", "kinematic", "--boot", "none"]
        rover += ["--truth", str(folder / "truth.csv")]
        ends.enter_context(process("-m", "rover_sim", *rover, folder=folder, name="rover"))
        it = Serving(server, folder, server.new_database(), ends, rover_port)
        for name, port in zip(names, clients, strict=True):
            it.clients[name] = port
            it.taps[name] = ends.enter_context(closing(Tap(name, rover_port, it.motions, it.zeros)))
            it.proxies[name] = ends.enter_context(closing(TcpProxy(server.port)))
            it.start(name)
        yield it


def _socket() -> socket.socket:
    it = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    it.bind(("127.0.0.1", 0))
    return it


def wait_for_holder(watcher: Watcher, *, other_than: str = "") -> str:
    """Wait until somebody, or somebody else, holds the rover; return its name."""
    wait_until(
        lambda: watcher.holder() not in ("", other_than), within=30, what="a holder of the rover"
    )
    return watcher.holder()
