"""Evenness of 20 Hz setpoints with 1 to 240 kinematic rovers driven by one server.

MAVLink has system ids for no more than 255 rovers, ground stations and servers.
"""

import json
from collections.abc import Callable
from statistics import quantiles
from time import sleep

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavState, MavType

from .child import child, free_port, simulated_rovers, udp_socket
from .scripted import CLIENT, loopback
from .table import Row

ROVERS = (1, 20, 100, 150, 240)
DRIVING = 12.0  # s
GATHER = 6.0  # s until all rovers are known and have sent a position
GOAL = 5e-3  # s
EACH = 0.003  # s between the submissions to two rovers


def measure() -> list[Row]:
    """Return a row for each number of rovers."""
    return [_row(rovers, _errors(rovers)) for rovers in ROVERS]


def _row(rovers: int, errors: list[float]) -> Row:
    cuts = quantiles(errors, n=100)
    has_goal = rovers == max(ROVERS)
    return Row(
        f"setpoint interval error, p99, {rovers} rovers",
        f"{cuts[98] * 1e3:.2f} ms",
        f"p50 {cuts[49] * 1e3:.2f} ms, {len(errors):,} intervals",
        "",
        f"< {GOAL * 1e3:.0f} ms" if has_goal else "",
        cuts[98] < GOAL if has_goal else None,
    )


def _errors(rovers: int) -> list[float]:
    port, vehicle_port = free_port(), free_port()
    options = str(port), str(vehicle_port), "--drive"
    with (
        simulated_rovers(rovers, vehicle_port),
        udp_socket() as client,
        child("server", *options, quiet=True) as said,
    ):
        client.connect(loopback(port))
        start_driving(client.send, rovers)
        sleep(DRIVING)  # it reads nothing; sending to it costs the server as much
    errors: list[float] = json.loads(said[-1])
    return errors


def start_driving(send: Callable[[bytes], object], rovers: int) -> None:
    """Wait until all rovers are known, and submit a long move to each."""
    encoder = Encoder(CLIENT)
    sleep(GATHER)
    send(encoder.encode(m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)))
    for system_id in range(1, rovers + 1):
        move = m.CommandLong(system_id, 191, MavCmd.TASK_MOVE, 0, 100.0, 0, 0, system_id, 0, 0, 5)
        send(encoder.encode(move))
        sleep(EACH)
