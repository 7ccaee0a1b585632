"""One end of a MAVLink link on the running loop, with pymavlink instead of our codec."""

import asyncio
import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any

os.environ["MAVLINK20"] = "1"  # pymavlink's switch, read when it is imported

from pymavlink.dialects.v20 import ardupilotmega as mav

from mav_tasks.links.base import TEND_PERIOD, Link, Peer, PeerState, StreamLink

BEAT = 1.0  # s between heartbeats
READ = 64  # datagrams per read
TO_AUTOPILOT = 1  # component


class Endpoint:
    """Receives and sends messages; sends a heartbeat each second."""

    def __init__(self, link: Link, heard: Callable[[Any], None], *, system_id: int = 255) -> None:
        self._link = link
        self._heard = heard
        self._loop = asyncio.get_running_loop()
        self._peers: dict[Peer, None] = dict.fromkeys(link.peers)
        self._mav = mav.MAVLink(self, srcSystem=system_id, srcComponent=191)
        self._mav.robust_parsing = True
        self.system = 1  # the rover's system id, updated by its heartbeat
        self.last: dict[str, Any] = {}
        self._loop.add_reader(link.fileno(), self._read)
        self._beating = asyncio.ensure_future(self._beat())

    @property
    def out(self) -> Any:
        """pymavlink's send methods."""
        return self._mav

    def write(self, data: bytes) -> None:
        """Send bytes; pymavlink calls this on its file object."""
        for peer in self._peers:
            self._link.send(peer, bytes(data))

    def command(self, number: int, *parameters: float) -> None:
        """Send a COMMAND_LONG to the autopilot."""
        values = (*parameters, *[0.0] * (7 - len(parameters)))
        self._mav.command_long_send(self.system, TO_AUTOPILOT, number, 0, *values)

    async def close(self) -> None:
        """Stop the heartbeats and close the link."""
        self._beating.cancel()
        with suppress(asyncio.CancelledError):
            await self._beating
        self._loop.remove_reader(self._link.fileno())
        self._link.close()

    async def _beat(self) -> None:
        beat_at = 0.0
        while True:
            if isinstance(self._link, StreamLink):
                self._link.poll()
                self._take_changes(self._link)
            now = self._loop.time()
            if now >= beat_at:
                beat_at = now + BEAT
                self._mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4)
            await asyncio.sleep(TEND_PERIOD if self._link.is_stream else BEAT)

    def _read(self) -> None:
        for peer, data in self._link.receive(READ):
            self._peers.setdefault(peer)
            for message in self._mav.parse_buffer(bytes(data)) or ():
                self._take(message)
        if isinstance(self._link, StreamLink):
            self._take_changes(self._link)

    def _take(self, message: Any) -> None:
        name = message.get_type()
        if name == "HEARTBEAT":
            if message.get_srcComponent() != TO_AUTOPILOT:
                return
            self.system = message.get_srcSystem()
        self.last[name] = message
        self._heard(message)

    def _take_changes(self, link: StreamLink) -> None:
        for change in link.take_changes():
            if change.state is PeerState.UP:
                self._peers.setdefault(change.peer)
            elif change.state is PeerState.DOWN:
                self._peers.pop(change.peer, None)
