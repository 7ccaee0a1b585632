"""Sources of true poses: a growing file, or a simulator's messages on a link."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from math import atan2, cos, radians
from pathlib import Path

from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.observer import Heard, Observer
from rover_sim.observing.track import Place, Track

EARTH = 6_378_137.0  # m, the equator's radius of WGS 84, as in autopilots
INTERVAL = 40_000  # µs
ASK_AGAIN = 2.0  # s between two requests of SIM_STATE: a restarted rover has lost them
LOOK = 0.02  # s between two reads of a file
COLUMNS = ["t", "north", "east", "yaw"]  # of a file without a line that names them


@contextmanager
def from_file(path: Path) -> Iterator[Track]:
    """Follow a file of lines ``t,north,east,yaw…``, or as its first line says, or of JSON."""
    track = Track()
    file = path.open(encoding="utf-8")
    first = file.readline().strip().split(",")
    columns = first if "north" in first else COLUMNS
    file.seek(0, 2)

    async def follow() -> None:
        loop, rest = asyncio.get_running_loop(), ""
        while True:
            *lines, rest = (rest + file.read()).split("\n")
            for line in lines:
                place = place_of(line, columns, loop.time())
                if place is not None:
                    track.add(place)
            await asyncio.sleep(LOOK)

    following = asyncio.ensure_future(follow())
    try:
        yield track
    finally:
        following.cancel()
        file.close()


def place_of(line: str, columns: list[str], now: float) -> Place | None:
    """Return the place in a line, with the time ``now``; None if it is not valid."""
    try:
        is_json = line.lstrip().startswith("{")
        said = json.loads(line) if is_json else dict(zip(columns, line.split(","), strict=False))
        return Place(now, float(said["north"]), float(said["east"]), float(said["yaw"]))
    except (ValueError, KeyError):
        return None


@contextmanager
def from_link(observer: Observer) -> Iterator[Track]:
    """Ask a simulator for SIM_STATE; read it, or HIL_STATE_QUATERNION."""
    track = Track()
    zero: list[tuple[int, int]] = []

    def take(heard: Heard) -> None:
        m = heard.message
        if heard.name == "SIM_STATE":
            place, yaw = (m.lat_int, m.lon_int), m.yaw
        elif heard.name == "HIL_STATE_QUATERNION":
            w, x, y, z = m.attitude_quaternion
            place, yaw = (m.lat, m.lon), atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        else:
            return
        if not place[0]:
            return
        zero.append(place)
        del zero[1:]
        north, east = (radians((a - b) / 1e7) * EARTH for a, b in zip(place, zero[0], strict=True))
        track.add(Place(heard.at, north, east * cos(radians(zero[0][0] / 1e7)), yaw))

    async def ask() -> None:
        while True:
            if observer.system:
                number, wanted = mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_SIM_STATE
                await observer.command(number, wanted, INTERVAL)
            await asyncio.sleep(ASK_AGAIN)

    observer.listeners.append(take)
    asking = asyncio.ensure_future(ask())
    try:
        yield track
    finally:
        asking.cancel()
