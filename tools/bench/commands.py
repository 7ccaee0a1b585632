"""COMMAND_LONG (TASK_MOVE, each with its own nonce) → COMMAND_ACK, compared with a bare echo.

The client is one process with blocking sockets. It packs everything beforehand and reads only the
message id of an answer.
"""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from statistics import quantiles
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd

from .child import child, free_port, udp_socket
from .scripted import CLIENT, ScriptedVehicle, loopback, meet
from .table import Row

WARM_UP = 2_000
ONE_BY_ONE = 5_000
OUTSTANDING = 64
MANY = 60_000
PATIENCE = 0.3  # s without an answer, after which outstanding commands count as lost
BEAT = 0.5  # s, between the vehicle's heartbeats

GOAL_RATIO, GOAL_DURABLE_RATIO = 1.6, 1.5  # of the yardstick's time
GOAL_RATE, GOAL_DURABLE_RATE = 0.65, 0.5  # of the echo's
SYNCS = 1_000
PAGE = 4_096  # bytes


def measure(profile: str | None = None) -> list[Row]:
    """Return the rows of latency and of rate, with the store in memory."""
    supply = packets()
    echo = _echo(supply)
    ours = _server(supply, *(() if profile is None else ("--profile", profile)))
    return [
        latency("command → ack, p50", ours[0], echo[0], goal=GOAL_RATIO),
        latency("command → ack, p99", ours[1], echo[1], goal=None),
        Row(
            f"acks, {OUTSTANDING} outstanding",
            f"{ours[2]:,.0f} /s",
            f"{echo[2]:,.0f} /s echo",
            f"{ours[2] / echo[2]:.0%}",
            f"≥ {GOAL_RATE:.0%}",
            ours[2] >= GOAL_RATE * echo[2],
        ),
    ]


def measure_durable() -> list[Row]:
    """Return the rows with the store on a disk, compared with an echo plus one fsync."""
    supply = packets()
    with TemporaryDirectory(dir=Path.cwd()) as folder:  # the project's disk
        sync = _fsync(Path(folder))
        echo = _echo(supply)
        ours = _server(supply, "--store", str(Path(folder) / "tasks.sqlite3"))
    yardstick, of = (echo[0] + sync[0], echo[1] + sync[1]), "echo + fsync"
    rows = [
        latency("durable → ack, p50", ours[0], yardstick[0], goal=GOAL_DURABLE_RATIO, of=of),
        latency("durable → ack, p99", ours[1], yardstick[1], goal=None, of=of),
    ]
    rate = Row(
        f"durable acks, {OUTSTANDING} outstanding",
        f"{ours[2]:,.0f} /s",
        f"{echo[2]:,.0f} /s echo",
        f"{ours[2] / echo[2]:.0%}",
        f"≥ {GOAL_DURABLE_RATE:.0%}",
        ours[2] >= GOAL_DURABLE_RATE * echo[2],
    )
    return [*rows, rate]


def measure_recorded() -> list[Row]:
    """Return latency and rate with each kind of record, compared with those without."""
    supply = packets()
    without = _server(supply)
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        for option, words in (("--tlog", "telemetry log"), ("--record", "decisions")):
            kept = _server(supply, option, folder)
            what = f"command → ack, p50, {words}"
            rows.append(latency(what, kept[0], without[0], goal=None, of="without"))
            rate = f"acks, {OUTSTANDING} outstanding, {words}"
            yardstick = f"{without[2]:,.0f} /s without"
            ratio = f"{kept[2] / without[2]:.0%}"
            rows.append(Row(rate, f"{kept[2]:,.0f} /s", yardstick, ratio, "", None))
    return rows


def _echo(packets: list[bytes]) -> tuple[float, float, float]:
    port = free_port()
    with child("bare", "echo", str(port)), udp_socket() as client:
        client.connect(loopback(port))
        return _run(client, packets, answer_id=m.CommandLong.id, vehicle=None)


def _server(commands: list[bytes], *options: str) -> tuple[float, float, float]:
    with server(*options) as (client, vehicle):
        return _run(client, commands, answer_id=m.CommandAck.id, vehicle=vehicle)


@contextmanager
def server(*options: str) -> Iterator[tuple[socket.socket, ScriptedVehicle]]:
    """Run a server with options for a block; yield the client's socket and the vehicle."""
    port = free_port()
    with udp_socket() as client, udp_socket() as vehicle_socket:
        vehicle_port: int = vehicle_socket.getsockname()[1]
        with child("server", str(port), str(vehicle_port), *options, quiet=True):
            vehicle = ScriptedVehicle(vehicle_socket)
            meet(vehicle, client, loopback(port))
            client.connect(loopback(port))
            yield client, vehicle


def _fsync(folder: Path) -> tuple[float, float]:
    """Return p50 and p99, in seconds, of appending a page to a file with an fsync."""
    times: list[float] = []
    with (folder / "bare").open("ab", buffering=0) as file:
        for _ in range(SYNCS):
            start = perf_counter()
            file.write(b"x" * PAGE)
            os.fsync(file.fileno())
            times.append(perf_counter() - start)
    cuts = quantiles(times, n=100)
    return cuts[49], cuts[98]


def latency(what: str, ours: float, echo: float, *, goal: float | None, of: str = "echo") -> Row:
    return Row(
        what,
        f"{ours * 1e6:.0f} µs",
        f"{echo * 1e6:.0f} µs {of}",
        f"{ours / echo:.1f}×",
        "" if goal is None else f"≤ {goal:g}×",
        None if goal is None else ours <= goal * echo,
    )


def _run(
    client: socket.socket,
    packets: list[bytes],
    *,
    answer_id: int,
    vehicle: ScriptedVehicle | None,
) -> tuple[float, float, float]:
    """Return p50 and p99 in seconds with one outstanding command, and answers/s with many."""
    supply = iter(packets)
    one_by_one(client, list(islice(supply, WARM_UP)), answer_id, vehicle)
    times = one_by_one(client, list(islice(supply, ONE_BY_ONE)), answer_id, vehicle)
    cuts = quantiles(times, n=100)
    return cuts[49], cuts[98], many(client, list(supply), answer_id, vehicle)


def one_by_one(
    client: socket.socket, packets: list[bytes], answer_id: int, vehicle: ScriptedVehicle | None
) -> list[float]:
    """Return the seconds until each answer, with one outstanding command."""
    times: list[float] = []
    next_beat = monotonic()
    for packet in packets:
        if vehicle is not None and monotonic() >= next_beat:
            vehicle.beat()
            next_beat += BEAT
        start = perf_counter()
        client.send(packet)
        while client.recv(512)[7] != answer_id:
            pass
        times.append(perf_counter() - start)
    return times


def many(
    client: socket.socket, packets: list[bytes], answer_id: int, vehicle: ScriptedVehicle | None
) -> float:
    """Return the answers per second with OUTSTANDING commands under way."""
    client.settimeout(PATIENCE)
    supply = iter(packets)
    answered = lost = under_way = 0
    next_beat = start = monotonic()
    for packet in islice(supply, OUTSTANDING):
        client.send(packet)
        under_way += 1
    while under_way:
        try:
            answer = client.recv(512)
        except TimeoutError:
            lost += under_way
            under_way = 0
            start += PATIENCE
        else:
            if answer[7] != answer_id:
                continue
            answered += 1
            under_way -= 1
        if vehicle is not None and answered % 512 == 0 and monotonic() >= next_beat:
            vehicle.beat()
            next_beat += BEAT
        for packet in islice(supply, OUTSTANDING - under_way):
            client.send(packet)
            under_way += 1
    rate = answered / (monotonic() - start)
    if lost:
        print(f"commands: {lost} of {len(packets)} were not answered")
    return rate


def packets() -> list[bytes]:
    """Return the commands of a run."""
    encoder = Encoder(CLIENT)
    total = WARM_UP + ONE_BY_ONE + MANY
    return [
        encoder.encode(m.CommandLong(1, 191, MavCmd.TASK_MOVE, 0, 1.0, 0, 0, nonce, 0, 0, 5))
        for nonce in range(1, total + 1)
    ]
