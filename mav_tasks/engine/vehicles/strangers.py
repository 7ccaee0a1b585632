"""What was heard lately of systems that are not vehicles of this server, not yet, or no more.

A vehicle is met with a heartbeat, at 1 Hz. To brake one that drives, its heading must be known in
that very moment, so the last positions before it are kept. In a fleet the last heartbeat of each
vehicle that another gateway has is kept, too.

Another autopilot may answer at a vehicle's address: then that is another vehicle. If that happens
again and again, two of them share an id, or a stranger sends in their name; then the id is served
only after one kind alone was heard for a while, each time for longer.
"""

from dataclasses import dataclass
from typing import NamedTuple

from mav_tasks.engine.inputs import Peer
from mav_tasks.engine.vehicles.sender_clock import Stamped
from mav_tasks.mavlink.messages import Attitude, Heartbeat, LocalPositionNed
from mav_tasks.mavlink.packet import Packet

RECENT = 0.5  # s; older positions tell nothing about a vehicle that drives
LAST_BEAT = 1.2  # s; heartbeats come each second
FREE_CHANGES = 2  # there and back: a single wrong heartbeat
ALONE, ALONE_AT_MOST = 5.0, 320.0  # s in which one must be heard alone after more changes
FORGOTTEN = 600.0  # s without a change
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


@dataclass(slots=True)
class _Changes:
    """How often another vehicle has come at one system id."""

    kind: bytes
    at: float
    count: int = 0

    @property
    def served_at(self) -> float:
        """When the id is served, unless another kind is heard before."""
        doubled = self.count - FREE_CHANGES - 1
        return self.at + (min(ALONE * 2**doubled, ALONE_AT_MOST) if doubled >= 0 else 0.0)


class Strangers:
    """The last messages of each system that is not a vehicle of this server."""

    def __init__(self) -> None:
        self._beats: dict[int, Beat] = {}
        self._moved: dict[int, dict[int, Moved]] = {}  # by system id and message id
        self._changes: dict[int, _Changes] = {}
        #: the last heartbeat at each id at which a vehicle was served before
        self.successors: dict[int, Beat] = {}

    def __repr__(self) -> str:
        return f"Strangers({sorted(self._beats.keys() | self._moved.keys())})"

    def changed(self, system_id: int, kind: bytes, *, now: float) -> None:
        """Note that another vehicle, of this kind, answers at an id that was served."""
        before = self._changes.get(system_id)
        count = 0 if before is None or now - before.at > FORGOTTEN else before.count
        self._changes[system_id] = _Changes(kind, now, count + 1)

    def is_alone(self, beat: Beat, kind: bytes) -> bool:
        """Note a heartbeat of this kind. Return whether no other kind is heard at its id.

        Where vehicles have changed too often, this one must have been alone for a while.
        """
        number, now = beat.packet.system_id, beat.at
        changes = self._changes.get(number)
        if changes is None:
            return True
        self.successors[number] = beat
        if changes.kind != kind and now >= changes.served_at:
            self.changed(number, kind, now=now)
        elif changes.kind != kind:
            changes.kind, changes.at = kind, now
        return now >= self._changes[number].served_at

    def note_beat(self, beat: Beat) -> None:
        """Keep the heartbeat of a vehicle that another gateway has."""
        self._beats[beat.packet.system_id] = beat

    def note_motion(self, system_id: int, moved: Moved) -> None:
        """Keep the last message of its kind."""
        self._moved.setdefault(system_id, {})[moved.message.id] = moved

    def heard_since(self, since: float) -> set[int]:
        """Return the vehicles of other gateways that were heard since then."""
        return {number for number, beat in self._beats.items() if beat.at >= since}

    def take_beat(self, system_id: int, *, now: float) -> Beat | None:
        """Return the last heartbeat if it came just now, and forget it: the vehicle is ours."""
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
