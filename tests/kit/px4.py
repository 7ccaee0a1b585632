"""PX4 and generic rovers of the scenarios, and requests of their clients."""

from math import nan

from rover_sim.personas import GENERIC, PX4
from tests.kit.client import FakeClient, Sent
from tests.kit.world import World, at

REPOSITION, SET_MODE = 192, 176
MANUAL, HOLD, MISSION, RETURN, OFFBOARD = (
    1 << 16,
    4 << 16 | 3 << 24,
    4 << 16 | 4 << 24,
    4 << 16 | 5 << 24,
    6 << 16,
)
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED, which MAVSDK sets, too

PROMPT_PX4, PROMPT_GENERIC = PX4, GENERIC


def go_to(world: World, north: float, east: float, *, yaw: float = nan) -> int:
    """Send the rover to a place, metres from the origin; return the task's id."""
    place = at(north, east)
    sent = world.client.command_int(REPOSITION, -1, 1, 0, yaw, **place, frame=6, target=(1, 1))
    world.run(0.2)
    return sent.task_id


def ask_mode(client: FakeClient, mode: int, *, target: tuple[int, int] = (1, 1)) -> Sent:
    """Request a mode as MAVSDK does."""
    return client.command(SET_MODE, 1 | ARMED, mode >> 16 & 0xFF, mode >> 24, target=target)
