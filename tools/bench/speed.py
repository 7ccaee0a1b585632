"""One server and one rover: commands, packets and uploads beside their yardsticks, and starts."""

import os
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import count, islice
from math import nan
from select import select
from tempfile import TemporaryFile
from time import perf_counter, sleep
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk, log_subscribe
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw.mission_raw import MissionItem
from mavsdk.plugins.mission_raw_server import MissionRawServer

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from tests.kit.postgres import connected
from tests.kit.processes import free_udp_ports

from .harness import (
    BUILD,
    CLI,
    HOST,
    OUTSTANDING,
    STANDING,
    Peer,
    Process,
    Rovers,
    Row,
    Rows,
    bare,
    beside,
    database,
    effect,
    introduced,
    move,
    p50,
    p99,
    paced,
    rate,
    server,
    simulated_rovers,
    timed,
)

WARM_UP, ONE_BY_ONE, MANY = 500, 3_000, 40_000  # commands
PAGE = b"x" * 4_096  # bytes of an fsync
INSERT = "INSERT INTO public.plain (body) VALUES (repeat('x', 300))"  # about a submission's row
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
SIZES = (50, 500)  # items of an upload
UPLOADS, FIRST = 20, 3  # the first are not counted
#: s before each upload. Within 0.6 s of the previous upload, the server waits for late items
#: (engine/missions/transfer.py); the upload to the other end is in between
BETWEEN = 0.35
FIND_WITHIN = 10.0  # s
LATITUDE, LONGITUDE = -353632621, 1491652374  # degE7, the simulated rover's start
METRE = 90  # degE7 of latitude, about
WAYPOINT: dict[str, Any] = {"frame": 6, "command": 16, "autocontinue": 1, "mission_type": 0}
WAYPOINT |= {"param1": 0.0, "param2": 1.0, "param3": 0.0, "param4": nan, "z": 0.0}


#: p50 and p99 of the seconds until a command's answer; answers a second with many under way
Acks = tuple[float, float, float]


def commands() -> Rows:
    """COMMAND_LONG (TASK_MOVE) → COMMAND_ACK, store in memory; beside a bare echo."""
    yield from _rows("", _served(), _echo(), "echo", "≤ 1.6×", "≥ 0.65×")


def durable() -> Rows:
    """The same with the store on a disk; beside an echo and an fsync."""
    median, most, acks = _echo()
    with TemporaryFile(dir=BUILD, buffering=0) as file:

        def write() -> None:
            file.write(PAGE)
            os.fsync(file)

        syncs = [timed(write) for _ in range(500)]
    both = median + p50(syncs), most + p99(syncs), acks
    ours = _served("--store=tasks.sqlite3")
    yield from _rows(", on the disk", ours, both, "echo + fsync", "≤ 1.5×", "≥ 0.5×")


def postgres() -> Rows:
    """The same with PostgreSQL on this machine; beside one INSERT, by turns."""
    inserts: list[float] = []
    with database() as it, connected(it.new_database()) as plain:
        plain.execute("CREATE TABLE public.plain (id BIGSERIAL, body TEXT)")

        def insert() -> None:
            inserts.append(timed(lambda: plain.execute(INSERT)))

        ours = _served(f"--store={it.new_database()}", between=insert)
    theirs = p50(inserts), p99(inserts), 1 / p50(inserts)
    yield from _rows(", on PostgreSQL", ours, theirs, "INSERT", "≤ 1.3×", "≥ 5,000 /s")


def recorded() -> Rows:
    """Commands to a server that writes a telemetry log, or a record; beside one that does not."""
    plain = _served()
    for option in ("--tlog", "--record"):
        yield from _rows(f", {option}", _served(f"{option}=here"), plain, "without", "", "")


def _rows(of: str, ours: Acks, beside: Acks, yardstick: str, *goals: str) -> Rows:
    yield Row(f"command → ack{of}, p50", ours[0], "µs", beside[0], yardstick, goals[0])
    yield Row(f"command → ack{of}, p99", ours[1], "µs", beside[1], yardstick)
    what, yardstick = f"acks, {OUTSTANDING} outstanding{of}", yardstick.partition(" ")[0]
    yield Row(what, ours[2], "/s", beside[2], yardstick, goals[1])


def _served(*options: str, between: Callable[[], None] = lambda: None) -> Acks:
    with introduced(*options) as (_, client, rover):
        return _acknowledged(client, m.CommandAck.id, rover.beat, between)


def _echo() -> Acks:
    with bare() as it, Peer(to=it.port) as client:
        return _acknowledged(client, m.CommandLong.id, client.beat, lambda: None)


def _acknowledged(
    client: Peer, answer: int, live: Callable[[], None], between: Callable[[], None]
) -> Acks:
    total = WARM_UP + ONE_BY_ONE + MANY
    packed = iter([client.encode(move(nonce)) for nonce in range(1, total + 1)])
    times = []
    for packet in islice(packed, WARM_UP + ONE_BY_ONE):
        live()
        between()
        times.append(effect(client, packet, answer, at=client))
    acks = rate(client, client, packed, lambda data: data[7] == answer, live)
    return p50(times[WARM_UP:]), p99(times[WARM_UP:]), acks


def forwarding() -> Rows:
    """Packets a second from rover to client, in a window; beside a bare forwarder."""
    packets, found = list(islice(_telemetry(), PACKETS)), []
    for way in (introduced(), _forwarder()):
        with way as (_, client, rover):
            came = rate(
                rover, client, iter(packets), lambda it: it[5:7] == b"\x01\x01", client.beat
            )
            found.append(came)
    yield Row("rover → client packets", found[0], "/s", found[1], "forwarder", "≥ 0.9×")


def telemetry() -> Rows:
    """Processor time for telemetry of 1 to 100 rovers and one station; beside a forwarder."""
    for rovers in ROVERS:
        found = []
        for way in (introduced(), _forwarder()):
            with way as (it, station, rover):
                _forwarded(SETTLING, rovers, station, rover)
                used = it.seconds()
                seconds = timed(lambda: _forwarded(WATCHED, rovers, station, rover))  # noqa: B023
                found.append((it.seconds() - used) / seconds)
        what = f"processor for {rovers} rovers, {RATE} packets/s each, of a core"
        yield Row(what, found[0], "%", found[1], "forwarder")


def _forwarded(seconds: float, rovers: int, station: Peer, rover: Rovers) -> None:
    """Send telemetry of rovers evenly, and answer what the server asks."""
    packets = _telemetry(rovers)
    for _ in paced(RATE, range(round(seconds * RATE))):
        station.beat()
        for packet in islice(packets, rovers):
            rover.send(packet)
        station.drain()
        for data in rover.drain():
            rover.answer(data)


@contextmanager
def _forwarder() -> Iterator[tuple[Process, Peer, Rovers]]:
    with Rovers() as rover, Peer() as client, bare(client.port) as it:
        rover.connect((HOST, it.port))
        client.connect((HOST, it.port))
        yield it, client, rover


def _telemetry(rovers: int = 1) -> Iterator[bytes]:
    """Yield packets without end, of one rover after another: RATE packets a second, a beat."""
    encoders = [Encoder(Address(number, 1)).encode for number in range(1, rovers + 1)]
    for turn in count():
        for at, encode in enumerate(encoders, turn):
            yield encode(TELEMETRY[at % len(TELEMETRY)] if at % RATE else STANDING)


def start() -> Rows:
    """From nothing to the first heartbeat, to help, to a script's first line; beside python -c."""

    def ran(*words: str) -> float:
        run = partial(subprocess.check_output, [sys.executable, *words])
        return p50([timed(run) for _ in range(STARTS + 1)][1:])  # the first fills the cache

    python = ran("-c", "pass")
    dialect, library = ran("-c", "import mav_tasks.mavlink._dialect"), ran("-c", LIBRARY)
    rows = [
        ("server start → first heartbeat", _first_heartbeat(), "≤ 1,000 ms"),
        ("mav-tasks --help", ran(*CLI, "--help"), "≤ 300 ms"),
        ("import mav_tasks", ran("-c", "import mav_tasks") - python, "≤ 150 ms"),
        (f"{LIBRARY}, but for the dialect", library - dialect, "≤ 150 ms"),
        (f"{LIBRARY}, all of it", library - python, ""),
    ]
    with simulated_rovers(1) as rover, server(rover) as it:
        it.wait_for("rover 1: found")
        to = f"--server=udpout:{HOST}:{it.port}"
        rows += [(f"mav-tasks {call}", ran(*CLI, *call.split(), to), "≤ 250 ms") for call in CALLS]
    for what, seconds, goal in rows:
        yield Row(what, seconds, "ms", python, "python -c pass", goal)


def _first_heartbeat() -> float:
    """Return the seconds from a server's start to its first packet at a pushed client."""
    times = []
    for _ in range(STARTS):
        with Peer() as client, Rovers() as rover:
            begin = perf_counter()
            with server(rover.port, f"--push={HOST}:{client.port}"):
                rover.wait()
                while client not in select([client, rover], [], [], 9.0)[0]:
                    rover.answer(rover.recv(2048))
                times.append(perf_counter() - begin)
    return p50(times)


def uploads() -> Rows:
    """Uploads by MAVSDK → durable acknowledgement; beside MAVSDK's server, which keeps no file.

    Both figures include the client's own cost.
    """
    log_subscribe(lambda *_: True)  # it logs to our output
    (port,) = free_udp_ports(1)
    times = defaultdict[tuple[int, int], list[float]](list)
    with (
        beside(_mission_server, port),
        simulated_rovers(1) as rover,
        server(rover, "--store=tasks.sqlite3") as it,
        ExitStack() as stack,
    ):
        it.wait_for("rover 1: found")
        found = (
            stack.enter_context(_mavsdk(ComponentType.GROUND_STATION, f"udpout://{HOST}:{each}"))
            for each in (it.port, port)
        )
        ends = [MissionRaw(each.first_autopilot(FIND_WITHIN)) for each in found]
        for number in range(FIRST + UPLOADS):
            for size in SIZES:
                items = _items(size, number)
                for at, end in enumerate(ends):
                    sleep(BETWEEN)  # an upload raises unless it is accepted
                    times[size, at].append(timed(lambda: end.upload_mission(items)))  # noqa: B023
        assert all(len(end.download_mission()) == size for end in ends)
    for size in SIZES:
        ours, theirs = (p50(times[size, at][FIRST:]) for at in (0, 1))
        what = f"upload of {size} items → durable ack, p50"
        yield Row(what, ours, "ms", theirs, "MAVSDK's server", "≤ 2×")


@contextmanager
def _mavsdk(kind: Any, url: str) -> Iterator[Any]:
    with Mavsdk(Configuration.create_with_component_type(kind)) as made:
        made.add_any_connection(url)
        yield made


def _mission_server(port: int) -> None:
    with _mavsdk(ComponentType.AUTOPILOT, f"udpin://{HOST}:{port}") as it:
        server = MissionRawServer(it.server_component())
        signal.pause()
        server.destroy()


def _items(size: int, number: int) -> list[Any]:
    """Return a line of waypoints, a metre apart; items of different numbers are all different."""
    y = LONGITUDE + METRE * number
    return [
        MissionItem(seq=seq, current=int(seq == 0), x=LATITUDE + METRE * seq, y=y, **WAYPOINT)
        for seq in range(size)
    ]
