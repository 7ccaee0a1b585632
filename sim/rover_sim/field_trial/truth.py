"""Sources of true poses: a growing file, or a simulator's messages on a link."""

import asyncio
import json
from contextlib import suppress
from io import TextIOWrapper
from math import atan2, cos, radians
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from mav_tasks.links.link_limits import TO_CLIENTS
from mav_tasks.links.url import parse_url
from rover_sim.field_trial.endpoint import Endpoint
from rover_sim.field_trial.track import Place, Track

EARTH = 6_378_137.0  # m, the equator's radius of WGS 84, as in autopilots
RATE_US = 40_000
ASK_PERIOD = 2.0  # s between two requests of SIM_STATE: a restarted rover has lost them
LOOK = 0.02  # s between two reads of a file


class FileTruth:
    """Follows a file of lines ``t,north,east,yaw…`` or of JSON objects with those names."""

    def __init__(self, path: Path) -> None:
        self.track = Track()
        self._file: TextIOWrapper = path.open(encoding="utf-8")
        self._file.seek(0, 2)
        self._rest = ""
        self._following = asyncio.ensure_future(self._follow())

    async def close(self) -> None:
        """Stop following and close the file."""
        self._following.cancel()
        with suppress(asyncio.CancelledError):
            await self._following
        self._file.close()

    async def _follow(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            *lines, self._rest = (self._rest + self._file.read()).split("\n")
            for line in lines:
                place = place_of(line, loop.time())
                if place is not None:
                    self.track.add(place)
            await asyncio.sleep(LOOK)


def place_of(line: str, now: float) -> Place | None:
    """Parse a line into a place with time ``now``; return None if it is not valid."""
    try:
        if line.lstrip().startswith("{"):
            said = json.loads(line)
            return Place(now, float(said["north"]), float(said["east"]), float(said["yaw"]))
        _, north, east, yaw, *_ = (float(word) for word in line.split(","))
    except (ValueError, KeyError):
        return None
    return Place(now, north, east, yaw)


class LinkTruth:
    """Requests SIM_STATE, and reads it and HIL_STATE_QUATERNION."""

    def __init__(self, url: str) -> None:
        self.track = Track()
        self._zero: tuple[int, int] | None = None
        self._loop = asyncio.get_running_loop()
        link = parse_url(url).open(limits=TO_CLIENTS)
        self.endpoint = Endpoint(link, self._take)
        self._asking = asyncio.ensure_future(self._ask())

    async def close(self) -> None:
        """Stop the requests and close the link."""
        self._asking.cancel()
        with suppress(asyncio.CancelledError):
            await self._asking
        await self.endpoint.close()

    async def _ask(self) -> None:
        while True:
            if "HEARTBEAT" in self.endpoint.last:
                wanted = mav.MAVLINK_MSG_ID_SIM_STATE
                self.endpoint.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, wanted, RATE_US)
            await asyncio.sleep(ASK_PERIOD)

    def _take(self, message: Any) -> None:
        name = message.get_type()
        if name == "SIM_STATE" and message.lat_int:
            self._place(message.lat_int, message.lon_int, message.yaw)
        elif name == "HIL_STATE_QUATERNION" and message.lat:
            w, x, y, z = message.attitude_quaternion
            self._place(
                message.lat, message.lon, atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            )

    def _place(self, latitude: int, longitude: int, yaw: float) -> None:
        zero = self._zero = self._zero or (latitude, longitude)
        north = radians((latitude - zero[0]) / 1e7) * EARTH
        east = radians((longitude - zero[1]) / 1e7) * EARTH * cos(radians(zero[0] / 1e7))
        self.track.add(Place(self._loop.time(), north, east, yaw))
