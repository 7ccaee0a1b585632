"""What is heard of a system id: the places of a vehicle, and of what is no vehicle of this server.

A place is a way to the vehicle if what answers there has its unique id, and its clock, as TIMESYNC
shows it. The server uses one way at a time, and goes on by another one if that brings packets while
the one in use is silent, or answers while the one in use does not.

A stranger is a system that is not a vehicle of this server, not yet, or no more. A vehicle is met
with a heartbeat, at 1 Hz. To brake one that drives, its heading must be known in that very moment,
so the last positions before it are kept. The last heartbeat is kept, too, of each vehicle that
another gateway has, and of what is not served.

Another autopilot at a vehicle's address is another vehicle. If that changes again soon, two share
an id, or a stranger sends in the name of one: none is served until one was heard alone for a while.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from math import inf
from operator import attrgetter
from typing import NamedTuple

from mav_tasks.engine.inputs import Place
from mav_tasks.engine.services.vehicle_status import uid_of
from mav_tasks.engine.vehicles.sender_clock import Stamped
from mav_tasks.mavlink.messages import (
    Attitude,
    AutopilotVersion,
    Heartbeat,
    LocalPositionNed,
    Message,
    Timesync,
)
from mav_tasks.mavlink.packet import Packet

SILENT = 0.5  # s; telemetry radios delay packets by less, and position data is lost after 1 s
UNANSWERED = 3.5  # s, as heartbeats that stay away: two requests or answers in a row may be lost
DRIFT = 0.3  # s between two TIMESYNC exchanges, of a simulator that is slower than real time
NANO = 1e9  # TIMESYNC is in ns
RECENT = 0.5  # s; older positions tell nothing about a vehicle that drives
LAST_BEAT = 1.2  # s; heartbeats come each second
ALONE = 10.0  # s
MOTION = (Attitude, LocalPositionNed)


@dataclass(slots=True)
class Way:
    """What is known about a place at which the id of a vehicle is heard."""

    first_at: float  # s, when it was first heard
    heard_at: float = -inf
    answered_at: float = -inf
    #: bounds of the vehicle's clock less ours, s
    least: float = -inf
    most: float = inf
    #: whether it leads to the vehicle; None: not known yet; False: another one is there, for good
    is_same: bool | None = None

    def note_answer(self, answer: Timesync, *, now: float) -> None:
        """Note the answer to our TIMESYNC request."""
        self.answered_at = now
        self.least, self.most = answer.tc1 / NANO - now, (answer.tc1 - answer.ts1) / NANO

    def judge(
        self, message: Message, uid: str, used: "Way | None", *, is_heard: bool, used_at: float
    ) -> None:
        """Look whether a message shows that this leads to the vehicle with that unique id.

        While that is heard at the place in use, both clocks must agree. If they do not, it may also
        have restarted here, as long as nothing came from there since (``used_at``).
        """
        if not isinstance(message, AutopilotVersion) or not uid or self.is_same is False:
            return
        self.is_same = uid_of(message) == uid
        if self.is_same and is_heard:
            if used is None or abs(self.answered_at - used.answered_at) > UNANSWERED:
                self.is_same = None  # it is asked again
            elif self.least - DRIFT > used.most or used.least > self.most + DRIFT:
                self.is_same = False if used_at > self.first_at else None

    def is_better_than(self, used: "Way | None", used_at: float, *, now: float) -> bool:
        """Return whether to use this way; the one in use brought its last packet at ``used_at``."""
        unanswered = used is not None and self.answered_at - used.answered_at > UNANSWERED
        return unanswered or (self.heard_at > used_at + SILENT / 2 and now > used_at + SILENT)


class Beat(NamedTuple):
    """A heartbeat, and where and when it came."""

    place: Place
    packet: Packet
    message: Heartbeat
    at: float


class Moved(NamedTuple):
    """A message about position or heading, and where and when it came."""

    place: Place
    message: Stamped
    at: float


class Strangers:
    """The last messages of each system that is not a vehicle of this server."""

    def __init__(self) -> None:
        #: the last heartbeats by system id
        self.beats: dict[int, Beat] = {}
        #: by system id and message id
        self.moved: dict[tuple[int, int], Moved] = {}
        #: by system id: which vehicle was heard there last, and from when on it may be served
        self._which: dict[int, tuple[Hashable, float]] = {}

    def is_alone(self, beat: Beat, which: Hashable) -> bool:
        """Note which vehicle is heard at an id. Return whether it may be served."""
        number = beat.packet.system_id
        self.beats[number] = beat
        before, since = self._which.get(number, (which, -inf))
        if which != before:
            since = beat.at + ALONE * (beat.at - since < ALONE)
        self._which[number] = which, since
        return beat.at >= since

    def share(self, system_id: int, *, now: float) -> bool:
        """Return whether two send with an id, so that none of them is served."""
        return system_id in self._which and now < self._which[system_id][1]

    def take_beat(self, system_id: int, *, now: float) -> Beat | None:
        """Return the last heartbeat if it came just now, and forget it."""
        beat = self.beats.pop(system_id, None)
        return beat if beat is not None and now - beat.at <= LAST_BEAT else None

    def take_motion(self, system_id: int, place: Place, *, now: float) -> list[Moved]:
        """Return what has just come from one place, in order, and forget it."""
        moved = [self.moved.pop((system_id, kind.id), None) for kind in MOTION]
        recent = [e for e in moved if e and e.place == place and now - e.at <= RECENT]
        return sorted(recent, key=attrgetter("at"))
