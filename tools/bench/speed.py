"""One server and one rover: commands, STOPs and packets a second, uploads, starts, calls."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import count, islice
from pathlib import Path
from select import select
from statistics import median
from tempfile import TemporaryFile
from time import monotonic, perf_counter, sleep

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from tests.kit.postgres import connected

from .processes import (
    BUILD,
    CLI,
    HOST,
    Process,
    bare,
    database,
    environment,
    server,
    simulated_rovers,
)
from .rows import Percentiles, Row, percentiles
from .wire import (
    OUTSTANDING,
    STANDING,
    Rovers,
    Speaker,
    effect,
    introduced,
    move,
    rate,
)

WARM_UP, ONE_BY_ONE, MANY = 500, 3_000, 40_000  # commands
Acks = tuple[Percentiles, float]  # seconds of one, and answers a second
ACK = m.CommandAck.id
PAGE = b"x" * 4_096  # bytes of an fsync
INSERT = "INSERT INTO public.plain (body) VALUES (%s)"
BODY = "x" * 300  # about the row of a submission
PACKETS = 60_000
ROVERS = (1, 20, 100)
RATE = 40  # packets/s of each rover
SETTLING, WATCHED = 3.0, 10.0  # s
LOCAL = m.LocalPositionNed(1000, 1.5, -2.5, 0.01, 0.3, 0.1, 0.001)
ATTITUDE = m.Attitude(1000, 0.01, 0.02, 1.2, 0.001, 0.002, 0.3)
GLOBAL = m.GlobalPositionInt(1000, 473977420, 85455940, 488000, 10, 30, 10, 0, 6900)
HUD = m.VfrHud(0.0, 0.3, 68, 20, 488.0, 0.0)
RC = m.RcChannels(1000, 8, *([1500] * 8 + [65535] * 10 + [255]))
#: about as often as a rover sends them
TELEMETRY = (LOCAL, ATTITUDE, RC, LOCAL, ATTITUDE, GLOBAL, LOCAL, ATTITUDE, RC, HUD)
STARTS = 5
CALLS = ("submit wait 0.1", "status 1", "queue", "vehicles")
LIBRARY = "from mav_tasks import Client, Move"


def commands(tree: Path) -> Iterator[Row]:
    """COMMAND_LONG (TASK_MOVE) → COMMAND_ACK, store in memory; beside a bare echo."""
    echo = _echo()
    yield from _rows("", _served(tree), echo, "echo", "≤ 1.6×", "≥ 0.65×")


def durable(tree: Path) -> Iterator[Row]:
    """The same with the store on a disk; beside an echo and an fsync."""
    times, acks = _echo()
    with TemporaryFile(dir=BUILD, buffering=0) as file:

        def write() -> None:
            file.write(PAGE)
            os.fsync(file)

        sync = percentiles([timed(write) for _ in range(500)])
    both = Percentiles(times.p50 + sync.p50, times.p99 + sync.p99)
    ours = _served(tree, "--store=tasks.sqlite3")
    yield from _rows(", on the disk", ours, (both, acks), "echo + fsync", "≤ 1.5×", "≥ 0.5×")


def postgres(tree: Path) -> Iterator[Row]:
    """The same with PostgreSQL on this machine; beside one INSERT, by turns."""
    inserts: list[float] = []
    with database() as it, connected(it.new_database()) as plain:
        plain.execute("CREATE TABLE public.plain (id BIGSERIAL, body TEXT)")

        def insert() -> None:
            inserts.append(timed(lambda: plain.execute(INSERT, (BODY,))))

        ours = _served(tree, f"--store={it.new_database()}", between=insert)
    theirs = percentiles(inserts)
    beside = theirs, 1 / theirs.p50
    yield from _rows(", on PostgreSQL", ours, beside, "INSERT", "≤ 1.3×", "≥ 5,000 /s")


def recorded(tree: Path) -> Iterator[Row]:
    """Commands to a server that writes a telemetry log, or a record; beside one that does not."""
    plain = _served(tree)
    for option in ("--tlog", "--record"):
        yield from _rows(f", {option}", _served(tree, f"{option}=here"), plain, "without")


def _rows(of: str, ours: Acks, beside: Acks, yardstick: str, *goals: str) -> Iterator[Row]:
    time_goal, rate_goal = goals or ("", "")
    (times, acks), (their, most) = ours, beside
    yield Row(f"command → ack{of}, p50", times.p50, "µs", their.p50, yardstick, time_goal)
    yield Row(f"command → ack{of}, p99", times.p99, "µs", their.p99, yardstick)
    what = f"acks, {OUTSTANDING} outstanding{of}"
    yield Row(what, acks, "/s", most, yardstick.partition(" ")[0], rate_goal)


def _served(tree: Path, *options: str, between: Callable[[], None] = lambda: None) -> Acks:
    with introduced(tree, *options) as (_, client, rover):
        return _acknowledged(client, ACK, rover.live, between)


def _echo() -> Acks:
    with bare() as it, Speaker(to=it.port) as client:
        return _acknowledged(client, m.CommandLong.id, lambda: None, lambda: None)


def _acknowledged(
    client: Speaker, answer: int, live: Callable[[], None], between: Callable[[], None]
) -> Acks:
    """Return the seconds of one command at a time, and answers/s with many under way."""
    total = WARM_UP + ONE_BY_ONE + MANY
    packed = iter([client.encode(move(nonce)) for nonce in range(1, total + 1)])
    times = []
    for packet in islice(packed, WARM_UP + ONE_BY_ONE):
        live()
        between()
        times.append(effect(client, packet, answer, at=client))
    acks = rate(client, client, packed, lambda data: data[7] == answer, live)
    return percentiles(times[WARM_UP:]), acks


def forwarding(tree: Path) -> Iterator[Row]:
    """Packets a second from rover to client, in a window; beside a bare forwarder."""
    packets, found = list(islice(_packets(), PACKETS)), []
    for way in (introduced(tree), _forwarder()):
        with way as (_, client, rover):
            found.append(rate(rover, client, packets, lambda data: data[5:7] == b"\x01\x01"))
    yield Row("rover → client packets", found[0], "/s", found[1], "forwarder", "≥ 0.9×")


@contextmanager
def _forwarder() -> Iterator[tuple[Process, Speaker, Rovers]]:
    with Rovers() as rover, Speaker() as client, bare(client.port) as it:
        rover.socket.connect((HOST, it.port))
        yield it, client, rover


def _packets(rovers: int = 1) -> Iterator[bytes]:
    """Yield telemetry without end, of one rover after another: RATE packets a second, a beat."""
    encoders = [Encoder(Address(number, 1)).encode for number in range(1, rovers + 1)]
    for turn in count():
        for at, encode in enumerate(encoders, turn):
            yield encode(TELEMETRY[at % len(TELEMETRY)] if at % RATE else STANDING)


def telemetry(tree: Path) -> Iterator[Row]:
    """Processor time for telemetry of 1 to 100 rovers and one station; beside a forwarder."""
    for rovers in ROVERS:
        with _forwarder() as (it, station, rover):
            their = _share(it, rovers, rover, station, lambda: None)
        with introduced(tree) as (it, station, rover):
            ours = _share(it, rovers, rover, station, station.beat)
        what = f"processor for {rovers} rovers, {RATE} packets/s each, of a core"
        yield Row(what, ours, "%", their, "forwarder")


def _share(
    it: Process, rovers: int, rover: Rovers, station: Speaker, live: Callable[[], None]
) -> float:
    """Return the processor seconds a second of a process that forwards the telemetry, evenly."""
    packets = _packets(rovers)
    begin = began = monotonic()
    used = 0.0
    for number in range(round((SETTLING + WATCHED) * RATE)):
        live()
        for packet in islice(packets, rovers):
            rover.socket.send(packet)
        station.drain()
        for data in rover.drain():
            rover.answer(data)
        if number == round(SETTLING * RATE):
            began, used = monotonic(), it.seconds()
        sleep(max(0.0, begin + (number + 1) / RATE - monotonic()))
    return (it.seconds() - used) / (monotonic() - began)


def start(tree: Path) -> Iterator[Row]:
    """From nothing to the first heartbeat, to help, to a script's first line; beside python -c."""

    def ran(*words: str) -> float:
        command = [sys.executable, *words]
        run = partial(
            subprocess.run, command, check=True, stdout=subprocess.DEVNULL, env=environment(tree)
        )
        return median([timed(run) for _ in range(STARTS + 1)][1:])  # the first fills the cache

    python = ran("-c", "pass")
    dialect, library = ran("-c", "import mav_tasks.mavlink._dialect"), ran("-c", LIBRARY)
    for what, seconds, goal in (
        ("server start → first heartbeat", _first_heartbeat(tree), "≤ 1,000 ms"),
        ("mav-tasks --help", ran(*CLI, "--help"), "≤ 300 ms"),
        ("import mav_tasks", ran("-c", "import mav_tasks") - python, "≤ 150 ms"),
        (f"{LIBRARY}, but for the dialect", library - dialect, "≤ 150 ms"),
        (f"{LIBRARY}, all of it", library - python, ""),
    ):
        yield Row(what, seconds, "ms", python, "python -c pass", goal)
    with simulated_rovers(1) as rover, server(tree, rover) as it:
        it.wait_for("rover 1: found")
        for call in CALLS:
            words = (*CLI, *call.split(), f"--server=udpout:{HOST}:{it.port}")
            yield Row(f"mav-tasks {call}", ran(*words), "ms", python, "python -c pass", "≤ 250 ms")


def _first_heartbeat(tree: Path) -> float:
    """Return the seconds from a server's start to its first packet at a pushed client."""
    times = []
    for _ in range(STARTS):
        with Speaker() as client, Rovers() as rover:
            begin = perf_counter()
            with server(tree, rover.port, f"--push={HOST}:{client.port}"):
                rover.connect()
                while client.socket not in select([client.socket, rover.socket], [], [], 9.0)[0]:
                    rover.answer(rover.socket.recv(2048))
                times.append(perf_counter() - begin)
    return median(times)


def timed(do: Callable[[], object]) -> float:
    """Return the seconds of a call."""
    begin = perf_counter()
    do()
    return perf_counter() - begin
