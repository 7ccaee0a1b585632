"""What rows are made of: figures, processes, peers on loopback, packets at a rate.

A server is ``mav-tasks serve`` of the revision that PYTHONPATH names; rovers are always this one's.
No process sees the user's configuration, keys or store. Peers pack everything beforehand, and read
only the id of an answer.
"""

import os
import re
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from math import ceil, inf
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import clock_gettime, monotonic, perf_counter, sleep
from typing import TypeVar

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavResult, MavState, MavType
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.postgres import installed
from tests.kit import processes
from tests.kit.postgres import PostgresServer
from tests.kit.processes import free_udp_ports

T = TypeVar("T")
Rows = Iterator["Row"]

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"  # on the project's disk
CHILD = str(Path(__file__).with_name("child.py"))
HOST = "127.0.0.1"
CLI = ("-P", "-m", "mav_tasks.cli")
OURS = f"{ROOT}:{ROOT / 'sim'}"  # the modules of this revision
os.environ |= {"MAV_TASKS_CONFIG": "", "MAV_TASKS_LINKS_PUSH": "", "MAV_TASKS_STORE": ":memory:"}
os.environ |= {"PYTHONDONTWRITEBYTECODE": "", "PYTHONHASHSEED": "0"}  # bytecode as if installed
#: as many commands as a measurement has, at any rate
UNLIMITED = [
    f"--set={setting}"
    for setting in (
        *("queueing.capacity=100000", "queueing.quota=100000", "clients.packet_rate=1000000"),
        *("clients.stream_interval=0", "roles.safety.quota=1000000", "roles.safety.rate=100000"),
    )
]
OUTSTANDING = 64
CLIENT = Address(245, 190)
STATION = m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
#: in HOLD, disarmed
STANDING = m.Heartbeat(MavType.GROUND_ROVER, MavAutopilot.ARDUPILOTMEGA, 1, 4, MavState.STANDBY, 3)
STOP = m.CommandLong(1, 191, MavCmd.TASK_STOP, 0, 0, 0, 0, 0, 0, 0, 0)
BEAT = 0.5  # s between two heartbeats
MEET_WITHIN = 5.0  # s
QUIET = 0.3  # s without a request: the server has completed its requests
SCALES = {"µs": 1e6, "ms": 1e3, "%": 1e2, "kB": 1e-3, "MB": 1e-6}  # of SI units


# figures


@dataclass(frozen=True, slots=True)
class Row:
    """A figure, shown in ``unit``; ``beside`` is the yardstick named ``of``. Both are in SI units.

    ``goal`` is a sign, a number and ``unit``, for the figure; or with ``×``, for its ratio to the
    yardstick: "≤ 5 ms", "≤ 1.6×".
    """

    what: str
    figure: float
    unit: str = ""
    beside: float = 0.0
    of: str = ""
    goal: str = ""
    note: str = ""

    def cells(self) -> tuple[str, ...]:
        """Return the cells of its line."""
        ratio = self.figure / self.beside if self.beside else inf
        yardstick = times = met = ""
        if self.of:
            yardstick, times = f"{shown(self.beside, self.unit)} {self.of}", f"{ratio:.2f}×"
        if self.goal:
            found = ratio if "×" in self.goal else self.figure * SCALES.get(self.unit, 1.0)
            is_more = found >= float(re.sub(r"[^\d.]", "", self.goal))
            met = "yes" if is_more == self.goal.startswith("≥") else "NO"
        return self.what, shown(self.figure, self.unit), yardstick, times, self.goal, met, self.note


def shown(value: float, unit: str) -> str:
    """Return a value with three digits or more, and its unit."""
    scaled = value * SCALES.get(unit, 1.0)
    digits = f"{scaled:,.0f}" if abs(scaled) >= 100 else f"{scaled:.3g}"
    return f"{digits} {unit}".rstrip()


def p99(values: Sequence[float]) -> float:
    """Return what 99 % of the values are at most; a lost answer is one after infinite time."""
    return sorted(values)[ceil(0.99 * (len(values) - 1))] if values else inf


def p50(values: Sequence[float]) -> float:
    """Return their median."""
    return median(values or [inf])


def timed(do: Callable[[], object]) -> float:
    """Return the seconds of a call."""
    begin = perf_counter()
    do()
    return perf_counter() - begin


# processes


@dataclass
class Process(processes.Process):
    """A process in a folder of its own; ``port`` is for its peers."""

    port: int = 0

    def seconds(self) -> float:
        """Return the processor time that it has used."""
        return cpu_seconds(self.popen.pid)

    def memory(self) -> int:
        """Return its resident memory, in bytes."""
        pages = Path(f"/proc/{self.popen.pid}/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")


def cpu_seconds(*pids: int) -> float:
    """Return the processor time that processes have used."""
    return sum(clock_gettime(~pid << 3 | 2) for pid in pids)  # clock_getcpuclockid(3) of Linux


@contextmanager
def process(*arguments: str, port: int = 0, **variables: str) -> Iterator[Process]:
    """Run Python for a ``with`` block, in a folder of its own; ``port`` is for its peers."""
    with TemporaryDirectory(dir=BUILD, ignore_cleanup_errors=True) as name:
        homes = {f"XDG_{kind}_HOME": name for kind in ("CONFIG", "DATA", "STATE")}
        env = {**os.environ, **homes, **variables}
        with processes.process(*arguments, folder=Path(name), name="its", env=env) as it:
            yield Process(it.popen, it.output, port)


@contextmanager
def beside(do: Callable[..., object] | None, *arguments: object) -> Iterator[None]:
    """Call a function, if there is one, in its own process for a ``with`` block, then kill it."""
    if do is None:
        yield
        return
    it = get_context("fork").Process(target=do, args=arguments)
    it.start()
    try:
        yield
    finally:
        it.kill()
        it.join()


@contextmanager
def bare(*to: int) -> Iterator[Process]:
    """Run the yardstick for a ``with`` block: an echo, or a forwarder to a port."""
    with process(CHILD, "bare", *map(str, to)) as it:
        it.port = int(it.wait_for(r"at (\d+)\n")[1])
        yield it


@contextmanager
def server(
    rover: int, *options: str, cli: tuple[str, ...] = CLI, is_limited: bool = False
) -> Iterator[Process]:
    """Run a server for a ``with`` block, for a client's port and a rover's."""
    (port,) = free_udp_ports(1)
    links = f"--client=udpin:{HOST}:{port}", f"--vehicle=udpout:{HOST}:{rover}"
    limits = [] if is_limited else UNLIMITED
    with process(*cli, "serve", *links, *limits, *options, port=port) as it:
        yield it


@contextmanager
def simulated_rovers(count: int, *, first: int = 1) -> Iterator[int]:
    """Run kinematic rovers for a ``with`` block; yield their UDP port."""
    (port,) = free_udp_ports(1)
    numbers = f"--count={count}", f"--system-id={first}", f"--port={port}"
    kind = "--body=kinematic", "--boot=none"
    with process("-m", "rover_sim", *kind, *numbers, PYTHONPATH=OURS):
        yield port


@contextmanager
def database() -> Iterator[PostgresServer]:
    """Run a database server for a ``with`` block, as durable as a user's."""
    with closing(PostgresServer(installed())) as made:
        made.start()
        yield made


# peers


class Peer(socket.socket):
    """A UDP socket of one MAVLink address; by default, of a client that is a ground station."""

    heartbeat = STATION

    def __init__(self, address: Address = CLIENT, *, to: int = 0) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_DGRAM)
        self.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.bind((HOST, 0))
        self.settimeout(1.0)
        if to:
            self.connect((HOST, to))
        self.port: int = self.getsockname()[1]
        self.encode = Encoder(address).encode
        self._next_beat = 0.0

    def beat(self) -> None:
        """Send a heartbeat if one is due."""
        if monotonic() >= self._next_beat:
            self._next_beat = monotonic() + BEAT
            self.send(self.encode(self.heartbeat))

    def drain(self) -> list[bytes]:
        """Return the datagrams that have come."""
        found = []
        self.settimeout(0.0)
        with suppress(BlockingIOError):
            while True:
                found.append(self.recv(2048))
        self.settimeout(1.0)
        return found


class Rovers(Peer):
    """Disarmed rovers on one socket: they accept every command, and execute none."""

    heartbeat = STANDING

    def __init__(self) -> None:
        super().__init__(Address(1, 1))

    def meet(self, client: Peer) -> None:
        """Make rover and client known to a server, and wait until its requests end."""
        self.wait()
        end = monotonic() + MEET_WITHIN
        with suppress(TimeoutError):
            while monotonic() < end:
                self.settimeout(QUIET)
                self.answer(self.recv(2048))
        client.beat()
        client.recv(2048)  # the rover's heartbeat, with which the server introduces it

    def wait(self) -> None:
        """Wait until the server speaks first; speak with it only from now on."""
        self.settimeout(10 * MEET_WITHIN)
        data, address = self.recvfrom(2048)
        self.connect(address)
        self.answer(data)

    def answer(self, data: bytes) -> list[m.Message | None]:
        """Answer heartbeats and commands in a datagram; return what was in it."""
        found = [Decoder().decode(packet) for packet in split_datagram(data)]
        for message in found:
            if isinstance(message, m.CommandLong):
                accepted = m.CommandAck(message.command, MavResult.ACCEPTED)
                self.send(Encoder(Address(message.target_system, 1)).encode(accepted))
            elif isinstance(message, m.Heartbeat):
                self.send(self.encode(STANDING))
        return found


@contextmanager
def introduced(*options: str, is_limited: bool = False) -> Iterator[tuple[Process, Peer, Rovers]]:
    """Run a server for a ``with`` block; yield it, with a client and a rover that it knows."""
    with (
        Rovers() as rover,
        server(rover.port, *options, is_limited=is_limited) as it,
        Peer(to=it.port) as client,
    ):
        rover.meet(client)
        yield it, client, rover


def move(nonce: int, distance: float = 1.0, *, rover: int = 1) -> m.CommandLong:
    """Return the submission of a task."""
    return m.CommandLong(rover, 191, MavCmd.TASK_MOVE, 0, distance, 0, 0, nonce, 0, 0, 5)


# load and its effect


def paced(rate: float, items: Iterable[T], wait: Callable[[float], object] = sleep) -> Iterator[T]:
    """Yield items at a rate; on a slow machine, more slowly."""
    begin, at_once = monotonic(), max(1, round(rate / 2000))  # waiting is not so exact
    for number, item in enumerate(items):
        if number % at_once == 0:
            wait(max(0.0, begin + number / rate - monotonic()))
        yield item


def flood(rate: float, packets: Iterable[bytes], peers: Iterable[Peer]) -> None:
    """Send datagrams at a rate, each from the next of these."""
    for packet, peer in paced(rate, zip(packets, peers, strict=False)):
        peer.send(packet)


def effect(client: Peer, packet: bytes, message_id: int, *, at: Peer, within: float = 1.0) -> float:
    """Return the seconds from sending to a message's arrival; infinity if it does not come."""
    at.settimeout(within)
    receive = at.recv
    start = perf_counter()
    client.send(packet)
    with suppress(TimeoutError):
        while receive(512)[7] != message_id:
            pass
        return perf_counter() - start
    return inf


def rate(
    out: Peer,
    back: Peer,
    packets: Iterator[bytes],
    is_answer: Callable[[bytes], bool],
    live: Callable[[], object],
) -> float:
    """Return the answers per second with OUTSTANDING packets under way; less those lost."""
    for packet in islice(packets, OUTSTANDING):
        out.send(packet)
    send, receive, answered = out.send, back.recv, 0
    start = monotonic()
    for packet in packets:
        while not is_answer(receive(512)):
            pass
        send(packet)
        answered += 1
        if answered % 512 == 0:
            live()
    return answered / (monotonic() - start)


def stops(
    ask: Callable[[], float], *, seconds: float = inf, count: int = 10**6, apart: float = 0.01
) -> list[float]:
    """Ask again and again; return the seconds of each."""
    found: list[float] = []
    end = monotonic() + seconds
    while len(found) < count and monotonic() < end:
        found.append(ask())
        sleep(apart)
    return found
