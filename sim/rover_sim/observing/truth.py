"""Sources of true poses: a growing file, or a simulator's messages on a link."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import atan2
from pathlib import Path

from pymavlink.dialects.v20 import development as mav

from rover_sim.geo import Origin
from rover_sim.observing.observer import Heard, Observer
from rover_sim.observing.track import Place, Track

INTERVAL = 40_000  # µs
ASK_AGAIN = 2.0  # s between two requests of SIM_STATE: a restarted rover has lost them
LOOK = 0.02  # s between two reads of a file
COLUMNS = ["t", "north", "east", "yaw"]  # of a file without a line that names them


@contextmanager
def from_file(path: Path) -> Iterator[Track]:
    """Follow a file of lines ``t,north,east,yaw…``, or of columns as its first line says."""
    track = Track()
    with path.open(encoding="utf-8") as file:
        first = file.readline().strip().split(",")
        columns = first if "north" in first else COLUMNS
        file.seek(0, 2)

        async def follow() -> None:
            loop, rest = asyncio.get_running_loop(), ""
            while True:
                *lines, rest = (rest + file.read()).split("\n")
                for line in lines:
                    with suppress(ValueError, KeyError):  # not a line of that kind
                        said = dict(zip(columns, line.split(","), strict=False))
                        pose = (float(said[name]) for name in ("north", "east", "yaw"))
                        track.add(Place(loop.time(), *pose))
                await asyncio.sleep(LOOK)

        following = asyncio.ensure_future(follow())
        try:
            yield track
        finally:
            following.cancel()


@contextmanager
def from_link(observer: Observer) -> Iterator[Track]:
    """Ask a simulator for SIM_STATE; read it, or HIL_STATE_QUATERNION."""
    track = Track()
    origin: Origin | None = None

    def take(heard: Heard) -> None:
        nonlocal origin
        m = heard.message
        if heard.name == "SIM_STATE":
            latitude, longitude, yaw = m.lat_int, m.lon_int, m.yaw
        elif heard.name == "HIL_STATE_QUATERNION":
            w, x, y, z = m.attitude_quaternion
            latitude, longitude = m.lat, m.lon
            yaw = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        else:
            return
        if latitude:
            origin = origin or Origin(latitude * 1e-7, longitude * 1e-7, 0.0)
            track.add(Place(heard.at, *origin.to_local(latitude, longitude), yaw))

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
