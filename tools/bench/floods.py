"""Floods from clients: their effect on STOP, setpoints and memory.

The flood comes on the same link, which is the worst case. A command that the kernel drops counts as
lost.
"""

import json
import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import quantiles
from time import monotonic, perf_counter, sleep

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd

from .child import child, free_port, simulated_rovers, udp_socket
from .client_flood import KINDS
from .scripted import CLIENT, ScriptedVehicle, ground_station, loopback, meet
from .table import Row

RATE = 20_000  # datagrams/s demanded; a slow machine sends fewer
STOPS = 150
BETWEEN = 0.01  # s
PATIENCE = 0.25  # s without an effect: lost
DRIVING = 5.0  # s
GATHER = 4.0  # s
STOP_GOAL = 5e-3  # s
SETPOINT_GOAL = 5e-3  # s
BEAT = 0.5  # s
KILOBYTE = 1024
ROVERS = 5


@dataclass(slots=True)
class Figures:
    """Figures under one flood, in seconds."""

    stop_p99: float
    stops_lost: int
    setpoint_p99: float
    grown: int  # kB of memory that the server grew under the flood


def measure() -> list[Row]:
    """Return the rows of every kind of flood."""
    calm = _figures("")
    return [row for kind in KINDS for row in _rows(kind, _figures(kind), calm)]


def _rows(kind: str, ours: Figures, calm: Figures) -> Iterator[Row]:
    what = f"flood of {kind}"
    yield Row(
        f"{what}: STOP → zero, p99",
        f"{ours.stop_p99 * 1e3:.2f} ms, {ours.stops_lost} of {STOPS} lost",
        f"{calm.stop_p99 * 1e3:.2f} ms without",
        f"{ours.stop_p99 / calm.stop_p99:.1f}×",
        f"< {STOP_GOAL * 1e3:.0f} ms",
        ours.stop_p99 < STOP_GOAL,
    )
    yield Row(
        f"{what}: setpoint interval error, p99",
        f"{ours.setpoint_p99 * 1e3:.2f} ms",
        f"{calm.setpoint_p99 * 1e3:.2f} ms without",
        f"{ours.setpoint_p99 / calm.setpoint_p99:.1f}×",
        f"< {SETPOINT_GOAL * 1e3:.0f} ms",
        ours.setpoint_p99 < SETPOINT_GOAL,
    )
    yield Row(f"{what}: memory grown", f"{ours.grown:,} kB", f"{calm.grown:,} kB", "", "", None)


def _figures(kind: str) -> Figures:
    times, lost = _stops(kind)
    errors, grown = _setpoints(kind)
    return Figures(quantiles(times, n=100)[98], lost, quantiles(errors, n=100)[98], grown)


@contextmanager
def _flood(kind: str, port: int) -> Iterator[None]:
    if not kind:
        yield
        return
    with child("client_flood", str(port), kind, str(RATE)):
        sleep(0.5)
        yield


def _stops(kind: str) -> tuple[list[float], int]:
    port = free_port()
    with ExitStack() as stack:
        client, vehicle_socket = (stack.enter_context(udp_socket()) for _ in range(2))
        options = str(port), str(vehicle_socket.getsockname()[1]), "--default-limits"
        stack.enter_context(child("server", *options, quiet=True))
        vehicle = ScriptedVehicle(vehicle_socket)
        meet(vehicle, client, loopback(port))
        client.connect(loopback(port))
        with _flood(kind, port):
            return _stopped(client, vehicle_socket, vehicle)


def _stopped(
    client: socket.socket, vehicle_socket: socket.socket, vehicle: ScriptedVehicle
) -> tuple[list[float], int]:
    encoder = Encoder(CLIENT)
    stop = m.CommandLong(1, 191, MavCmd.TASK_STOP, 0, 0, 0, 0, 0, 0, 0, 0)
    times: list[float] = []
    lost = 0
    next_beat = 0.0
    for _ in range(STOPS):
        if monotonic() >= next_beat:
            vehicle.beat()
            client.send(encoder.encode(ground_station()))
            next_beat = monotonic() + BEAT
        _drain(vehicle_socket)
        _drain(client)
        start = perf_counter()
        client.send(encoder.encode(stop))
        if _zero_comes(vehicle_socket):
            times.append(perf_counter() - start)
        else:
            lost += 1
        sleep(BETWEEN)
    return times, lost


def _zero_comes(vehicle_socket: socket.socket) -> bool:
    vehicle_socket.settimeout(PATIENCE)
    with suppress(TimeoutError):
        while vehicle_socket.recv(512)[7] != m.SetPositionTargetLocalNed.id:
            pass
        return True
    return False


def _setpoints(kind: str) -> tuple[list[float], int]:
    port, vehicle_port = free_port(), free_port()
    options = str(port), str(vehicle_port), "--drive", "--default-limits"
    with (
        simulated_rovers(ROVERS, vehicle_port),
        udp_socket() as client,
        child("server", *options, quiet=True) as said,
    ):
        client.connect(loopback(port))
        sleep(GATHER)
        encoder = Encoder(CLIENT)
        for system_id in range(1, ROVERS + 1):
            move = m.CommandLong(system_id, 191, MavCmd.TASK_MOVE, 0, 100, 0, 0, system_id, 0, 0, 5)
            client.send(encoder.encode(move))
        sleep(1.0)
        server = _server_of(port)
        with _flood(kind, port):
            sleep(1.0)
            before = _resident(server)
            sleep(DRIVING)
            grown = _resident(server) - before
    errors: list[float] = json.loads(said[-1])
    return errors, grown


def _server_of(port: int) -> int:
    """Return the process id of the server with this port in its arguments."""
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (folder / "cmdline").read_bytes().split(b"\0")
            if b"tools.bench.server" in words and str(port).encode() in words:
                return int(folder.name)
    return os.getpid()


def _resident(process: int) -> int:
    """Return the resident memory of a process, in kB."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // KILOBYTE


def _drain(sock: socket.socket) -> None:
    sock.settimeout(0.0)
    with suppress(BlockingIOError):
        while True:
            sock.recv(2048)
