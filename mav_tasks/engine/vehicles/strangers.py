"""What was heard lately of systems that are not vehicles of this server, not yet, or no more.

A vehicle is met with a heartbeat, at 1 Hz. To brake one that drives, its heading must be known in
that very moment, so the last positions before it are kept. The last heartbeat is kept, too, of each
vehicle that another gateway has, and of what is not served.

Another autopilot at a vehicle's address is another vehicle. If that changes again soon, two share
an id, or a stranger sends in the name of one: none is served until one was heard alone for a while.
"""

from collections.abc import Hashable
from math import inf
from typing import NamedTuple

from mav_tasks.engine.inputs import Peer
from mav_tasks.engine.vehicles.sender_clock import Stamped
from mav_tasks.mavlink.messages import Attitude, Heartbeat, LocalPositionNed
from mav_tasks.mavlink.packet import Packet

RECENT = 0.5  # s; older positions tell nothing about a vehicle that drives
LAST_BEAT = 1.2  # s; heartbeats come each second
ALONE = 10.0  # s
MOTION = (Attitude, LocalPositionNed)


class Beat(NamedTuple):
    """A heartbeat, and where and when it came."""

    link: str
    peer: Peer
    packet: Packet
    message: Heartbeat
    at: float


class Moved(NamedTuple):
    """A message about position or heading, and where and when it came."""

    link: str
    peer: Peer
    message: Stamped
    at: float


class Strangers:
    """The last messages of each system that is not a vehicle of this server."""

    def __init__(self) -> None:
        self._beats: dict[int, Beat] = {}
        self._moved: dict[int, dict[int, Moved]] = {}  # by system id and message id
        #: by system id: which vehicle was heard there last, and from when on it may be served
        self._which: dict[int, tuple[Hashable, float]] = {}

    def __repr__(self) -> str:
        return f"Strangers({sorted(self._beats.keys() | self._moved.keys())})"

    def is_alone(self, beat: Beat, which: Hashable) -> bool:
        """Note which vehicle is heard at an id. Return whether it may be served."""
        self.note_beat(beat)
        before, since = self._which.get(beat.packet.system_id, (which, -inf))
        if which != before:
            since = beat.at + ALONE * (beat.at - since < ALONE)
        self._which[beat.packet.system_id] = which, since
        return beat.at >= since

    def note_beat(self, beat: Beat) -> None:
        """Keep the heartbeat of a vehicle that another gateway has, or that is not served."""
        self._beats[beat.packet.system_id] = beat

    def note_motion(self, system_id: int, moved: Moved) -> None:
        """Keep the last message of its kind."""
        self._moved.setdefault(system_id, {})[moved.message.id] = moved

    def heard_since(self, since: float) -> set[int]:
        """Return the vehicles of other gateways, and those not served, heard since then."""
        return {number for number, beat in self._beats.items() if beat.at >= since}

    def take_beat(self, system_id: int, *, now: float) -> Beat | None:
        """Return the last heartbeat if it came just now, and forget it."""
        beat = self._beats.pop(system_id, None)
        return beat if beat is not None and now - beat.at <= LAST_BEAT else None

    def take_motion(self, system_id: int, link: str, peer: Peer, *, now: float) -> list[Moved]:
        """Return what has just come from one place, in order, and forget it."""
        moved = self._moved.pop(system_id, {}).values()
        recent = [
            each
            for each in moved
            if (each.link, each.peer) == (link, peer) and now - each.at <= RECENT
        ]
        return sorted(recent, key=lambda each: each.at)
