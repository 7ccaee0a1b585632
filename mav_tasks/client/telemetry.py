"""Waits for the telemetry of rovers that were found only now."""

import asyncio
from collections.abc import Callable

from mav_tasks.client.aio import Client
from mav_tasks.client.fleet_view import SILENT_AFTER
from mav_tasks.client.values import VehicleStatus

LOOK = 0.01  # s between two checks
LOOKS = 150


async def all_show(client: Client, is_shown: Callable[[VehicleStatus], bool]) -> None:
    """Wait until each rover shows what is wanted or is known to be silent, for 1.5 s at most.

    The server is found by its own heartbeat; a rover's comes in a packet behind it, and telemetry
    once a second.
    """
    for _ in range(LOOKS):
        if all(is_shown(each) or _is_silent(each) for each in client.vehicles()):
            return
        await asyncio.sleep(LOOK)


def _is_silent(rover: VehicleStatus) -> bool:
    return rover.heartbeat_age is not None and rover.heartbeat_age > SILENT_AFTER
