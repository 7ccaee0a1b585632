"""Processor time of a server that forwards telemetry to one station and drives nothing.

Each rover sends a repeated second of telemetry, thinned to RATE packets, evenly. A bare forwarder
of as many packets is the yardstick. One process is all rovers and the station.
"""

import os
import socket
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavResult, MavState, MavType
from mav_tasks.mavlink.packet import split_datagram

from .child import child, free_port, udp_socket
from .scripted import CLIENT, HOLD, ground_station, loopback
from .table import Row

ROVERS = (1, 20, 100)
RATE = 40  # packets a second of each rover
STEP = 0.025  # s between two bursts: one packet of each rover
WARM_UP, LONG = 5.0, 15.0  # s
TICKS = os.sysconf("SC_CLK_TCK")  # a second, of processor time in /proc


def measure() -> list[Row]:
    """Return a row for each number of rovers."""
    rows = []
    for rovers in ROVERS:
        bare, ours = _bare(rovers), _ours(rovers)
        rows.append(
            Row(
                f"processor for {rovers} rovers, {RATE} packets/s each",
                f"{100 * ours:.1f} % of a core",
                f"{100 * bare:.1f} % forwarder",
                f"{ours / bare:.1f}×" if bare else "",
                "",
                None,
            )
        )
    return rows


def _bare(rovers: int) -> float:
    port = free_port()
    with udp_socket() as station, udp_socket() as vehicle:
        station_port: int = station.getsockname()[1]
        with child("bare", "forward", str(port), str(station_port)) as forwarder:
            return _share(forwarder.pid, rovers, vehicle, loopback(port), station, None)


def _ours(rovers: int) -> float:
    port = free_port()
    with udp_socket() as station, udp_socket() as vehicle:
        vehicle_port: int = vehicle.getsockname()[1]
        with child("server", str(port), str(vehicle_port), quiet=True) as server:
            _, to = vehicle.recvfrom(2048)
            return _share(server.pid, rovers, vehicle, to, station, loopback(port))


def _share(
    pid: int,
    rovers: int,
    vehicle: socket.socket,
    to: tuple[str, int],
    station: socket.socket,
    server: tuple[str, int] | None,
) -> float:
    """Return the processor seconds per second of a process that forwards the telemetry."""
    for each in (vehicle, station):
        each.setblocking(False)
    hello = Encoder(CLIENT).encode(ground_station())
    bursts = _bursts(rovers)
    begin = monotonic()
    measured = used = 0.0
    number = 0
    while (past := number * STEP) < WARM_UP + LONG:
        if server is not None and number % round(1 / STEP) == 0:
            station.sendto(hello, server)
        for packet in next(bursts):
            vehicle.sendto(packet, to)
        for _ in _received(station):
            pass
        for data in _received(vehicle):
            for answer in _answers(data):
                vehicle.sendto(answer, to)
        number += 1
        if not measured and past >= WARM_UP:
            measured, used = monotonic(), _processor(pid)
        sleep(max(0.0, begin + number * STEP - monotonic()))
    return (_processor(pid) - used) / (monotonic() - measured)


def _received(each: socket.socket) -> Iterator[bytes]:
    try:
        while True:
            yield each.recv(2048)
    except BlockingIOError:
        pass


def _answers(data: bytes) -> Iterator[bytes]:
    """Yield the acknowledgements of the server's commands, which it would repeat otherwise."""
    for packet in split_datagram(data):
        message = Decoder().decode(packet)
        if isinstance(message, m.CommandLong):
            rover = Encoder(Address(message.target_system, 1))
            yield rover.encode(m.CommandAck(message.command, MavResult.ACCEPTED))


def _processor(pid: int) -> float:
    """Return the processor seconds of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def _bursts(rovers: int) -> Iterator[list[bytes]]:
    """Yield bursts without end: the next packet of each rover."""
    encoders = [Encoder(Address(number, 1)) for number in range(1, rovers + 1)]
    at = 0
    while True:
        at += 1
        yield [encoder.encode(_message(at + number)) for number, encoder in enumerate(encoders)]


def _message(number: int) -> m.Message:
    """Return a packet of a rover that stands: a heartbeat a second, else three of its state."""
    ms = round(1000 * number * STEP)
    if number % RATE == 0:
        return m.Heartbeat(
            MavType.GROUND_ROVER, MavAutopilot.ARDUPILOTMEGA, 1, HOLD, MavState.STANDBY, 3
        )
    match number % 4:
        case 0:
            return m.VfrHud(0.0, 0.3, 68, 20, 488.0, 0.0)
        case 1:
            return m.Attitude(ms, 0.01, 0.02, 1.2, 0.001, 0.002, 0.3)
        case 2:
            return m.GlobalPositionInt(ms, 473977420, 85455940, 488000, 10, 30, 10, 0, 6900)
        case _:
            return m.LocalPositionNed(ms, 1.5, -2.5, 0.01, 0.3, 0.1, 0.001)
