"""STOP: datagram in → zero setpoint out, while the vehicle floods the server with telemetry."""

import socket
from contextlib import suppress
from statistics import quantiles
from time import monotonic, perf_counter, sleep

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd

from .child import child, free_port, udp_socket
from .scripted import CLIENT, ScriptedVehicle, loopback, meet
from .table import Row

STOPS = 400
BETWEEN = 0.01  # s
FLOOD = 5_000  # datagrams/s
GOAL = 5e-3  # s
BEAT = 0.5  # s, between the vehicle's heartbeats


def measure() -> list[Row]:
    """Return the rows without and with the flood."""
    calm, flooded = _times(0), _times(FLOOD)
    return [
        _row("STOP → zero setpoint, p99", flooded[1], calm[1], goal=GOAL),
        _row("STOP → zero setpoint, p50", flooded[0], calm[0], goal=None),
    ]


def _row(what: str, ours: float, calm: float, *, goal: float | None) -> Row:
    return Row(
        f"{what}, {FLOOD:,} packets/s",
        f"{ours * 1e3:.2f} ms",
        f"{calm * 1e3:.2f} ms without",
        f"{ours / calm:.1f}×",
        "" if goal is None else f"< {goal * 1e3:.0f} ms",
        None if goal is None else ours < goal,
    )


def _times(flood: int) -> tuple[float, float]:
    port = free_port()
    with udp_socket() as client, udp_socket() as vehicle_socket:
        vehicle_port: int = vehicle_socket.getsockname()[1]
        with child("server", str(port), str(vehicle_port), quiet=True):
            vehicle = ScriptedVehicle(vehicle_socket)
            meet(vehicle, client, loopback(port))
            client.connect(loopback(port))
            if not flood:
                return _stops(client, vehicle_socket, vehicle)
            assert vehicle.server is not None
            arguments = str(vehicle_socket.fileno()), str(vehicle.server[1]), str(flood)
            with child("flood", *arguments, pass_fds=(vehicle_socket.fileno(),)):
                sleep(0.3)
                return _stops(client, vehicle_socket, vehicle)


def _stops(
    client: socket.socket, vehicle_socket: socket.socket, vehicle: ScriptedVehicle
) -> tuple[float, float]:
    encoder = Encoder(CLIENT)
    times: list[float] = []
    next_beat = monotonic()
    for _ in range(STOPS):
        if monotonic() >= next_beat:
            vehicle.beat()
            next_beat = monotonic() + BEAT
        _drain(vehicle_socket)
        _drain(client)
        stop = m.CommandLong(1, 191, MavCmd.TASK_STOP, 0, 0, 0, 0, 0, 0, 0, 0)
        packet = encoder.encode(stop)
        vehicle_socket.settimeout(1.0)
        start = perf_counter()
        client.send(packet)
        while vehicle_socket.recv(512)[7] != m.SetPositionTargetLocalNed.id:
            pass
        times.append(perf_counter() - start)
        sleep(BETWEEN)
    cuts = quantiles(times, n=100)
    return cuts[49], cuts[98]


def _drain(sock: socket.socket) -> None:
    sock.settimeout(0.0)
    with suppress(BlockingIOError):
        while True:
            sock.recv(2048)
