"""Packets forwarded from vehicle to client, compared with a bare forwarder.

The packets repeat one second of a rover's telemetry, at the rates that the server requests. One
process is both vehicle and client. It keeps a window of packets under way, so that full buffers
lose nothing and each of the two processes has a core.
"""

import socket
from itertools import cycle, islice
from time import monotonic

from mav_tasks.engine.services.interval_requester import WANTED
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavState, MavType

from .child import child, free_port, udp_socket
from .scripted import HOLD, VEHICLE, ScriptedVehicle, loopback, meet
from .table import Row

WINDOW = 64
WARM_UP = 5_000
PACKETS = 100_000
PATIENCE = 0.3  # s without a packet, after which packets under way count as lost
GOAL = 0.9


def measure(profile: str | None = None) -> list[Row]:
    """Return the row of forwarding."""
    bare, ours = _bare(), _ours(profile)
    return [
        Row(
            "vehicle → client packets",
            f"{ours:,.0f} /s",
            f"{bare:,.0f} /s forwarder",
            f"{ours / bare:.0%}",
            f"≥ {GOAL:.0%}",
            ours >= GOAL * bare,
        )
    ]


def _bare() -> float:
    port = free_port()
    with udp_socket() as client, udp_socket() as vehicle:
        client_port: int = client.getsockname()[1]
        with child("bare", "forward", str(port), str(client_port)):
            return _rate(vehicle, client, loopback(port))


def _ours(profile: str | None) -> float:
    port = free_port()
    extra = () if profile is None else ("--profile", profile)
    with udp_socket() as client, udp_socket() as vehicle_socket:
        vehicle_port: int = vehicle_socket.getsockname()[1]
        with child("server", str(port), str(vehicle_port), *extra, quiet=True):
            vehicle = ScriptedVehicle(vehicle_socket)
            meet(vehicle, client, loopback(port))
            assert vehicle.server is not None
            return _rate(vehicle_socket, client, vehicle.server)


def _rate(vehicle: socket.socket, client: socket.socket, to: tuple[str, int]) -> float:
    """Return the packets per second that reach the client."""
    vehicle.connect(to)
    client.settimeout(PATIENCE)
    packets = cycle(_telemetry())
    _pump(vehicle, client, list(islice(packets, WARM_UP)))
    start = monotonic()
    arrived, waited = _pump(vehicle, client, list(islice(packets, PACKETS)))
    if arrived < 0.99 * PACKETS:
        print(f"forwarding: {arrived} of {PACKETS} arrived")
    return arrived / (monotonic() - start - waited)


def _pump(vehicle: socket.socket, client: socket.socket, packets: list[bytes]) -> tuple[int, float]:
    """Send packets through a window; return how many arrived, and the seconds of waiting."""
    supply = iter(packets)
    arrived, waited, under_way = 0, 0.0, 0
    for packet in islice(supply, WINDOW):
        vehicle.send(packet)
        under_way += 1
    while under_way > 0:
        try:
            source = client.recv(512)[5:7]
        except TimeoutError:
            waited += PATIENCE
            under_way = 0
        else:
            if source != bytes(VEHICLE):  # sent by the server
                continue
            arrived += 1
            under_way -= 1
        for packet in islice(supply, WINDOW - under_way):
            vehicle.send(packet)
            under_way += 1
    return arrived, waited


def _telemetry() -> list[bytes]:
    """Return a second of telemetry, repeated until its sequence numbers wrap."""
    heartbeat = m.Heartbeat(
        MavType.GROUND_ROVER, MavAutopilot.ARDUPILOTMEGA, 1, HOLD, MavState.STANDBY, 3
    )
    samples: dict[int, m.Message] = {
        m.LocalPositionNed.id: m.LocalPositionNed(1000, 1.5, -2.5, 0.01, 0.3, 0.1, 0.001),
        m.Attitude.id: m.Attitude(1000, 0.01, 0.02, 1.2, 0.001, 0.002, 0.3),
        m.GlobalPositionInt.id: m.GlobalPositionInt(
            1000, 473977420, 85455940, 488000, 10, 30, 10, 0, 6900
        ),
        m.VfrHud.id: m.VfrHud(0.0, 0.3, 68, 20, 488.0, 0.0),
        m.SysStatus.id: m.SysStatus(1, 1, 1, 100, 12600, -1, 90, 0, 0, 0, 0, 0, 0),
        m.ExtendedSysState.id: m.ExtendedSysState(0, 1),
        m.GpsRawInt.id: m.GpsRawInt(
            1_000_000, 3, 473977420, 85455940, 488000, 80, 120, 30, 6900, 12
        ),
        m.BatteryStatus.id: m.BatteryStatus(
            0, 0, 1, 2500, [4200, 4200, 4200] + [65535] * 7, 120, 10, 10, 90
        ),
        m.SystemTime.id: m.SystemTime(1_700_000_000_000_000, 1000),
        m.HomePosition.id: m.HomePosition(
            473977420, 85455940, 488000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0
        ),
        m.MissionCurrent.id: m.MissionCurrent(0),
        m.RcChannels.id: m.RcChannels(1000, 8, *([1500] * 8 + [65535] * 10 + [255])),
    }
    due: list[tuple[float, m.Message]] = [(0.0, heartbeat)]
    for message_id, interval in WANTED.items():
        due += [(n * interval, samples[message_id]) for n in range(max(1, round(1 / interval)))]
    second = [message for _, message in sorted(due, key=lambda item: item[0])]
    encoder = Encoder(VEHICLE)
    return [encoder.encode(message) for _ in range(256) for message in second]
