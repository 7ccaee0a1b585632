"""The places at which the id of a vehicle is heard: ways to it, or another vehicle with its id.

A place is a way to the vehicle if what answers there has its unique id, and its clock as TIMESYNC
shows it; a vehicle that reports no unique id has one place. The server uses one way at a time. It
goes on by another one when that has brought some packets since the one in use brought its last, or
is answered while the one in use is not.
"""

from dataclasses import dataclass
from math import inf

from mav_tasks.engine.vehicles.sender_clock import Stamped
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.router import Place
from mav_tasks.services.heartbeat import kind_of
from mav_tasks.services.identity import uid_of

MOST = 256  # places remembered; one more replaces the oldest
TRIES = 10  # heartbeats with which a place is asked who is there, and a way for position data
BRINGS = 3  # packets that another way has brought, for the one in use to be silent
SILENT = 0.5  # s: a telemetry radio delays packets by less; position data is lost after 1 s
UNANSWERED = 3.5  # s, as heartbeats that stay away: two requests or answers in a row may be lost
BOTH_THERE = 1.0  # s; by then, delayed packets from the old place have come
DRIFT = 0.3  # s between two TIMESYNC exchanges, of a simulator that is slower than real time
ENOUGH = 4  # positions and attitudes a second, on a way that is not in use

NANO = 1e9  # TIMESYNC is in ns


@dataclass(slots=True)
class Way:
    """What is known about a place."""

    first_at: float  # s, when it was first heard
    heard_at: float = -inf
    answered_at: float = -inf
    #: bounds of the vehicle's clock less ours, s
    clock: tuple[float, float] = (-inf, inf)
    uid: str | None = None  # that was reported there
    kind: tuple[int, int] | None = None
    is_same: bool = False  # whether it leads to the vehicle
    is_another: bool = False  # whether another vehicle is there, for good
    asked: int = 0
    positions: int = 0  # and attitudes, since its last heartbeat
    since: float = -inf  # when the place in use brought its last packet
    news: int = 0  # packets since then

    def hear(self, message: m.Message, *, lost_after: float, now: float) -> None:
        """Note a message of the autopilot there."""
        if now - self.heard_at > lost_after:  # anybody may be there now
            self.uid, self.is_same, self.asked = None, False, 0
        self.heard_at = now
        if isinstance(message, m.Heartbeat):
            self.kind = kind_of(message)
        elif isinstance(message, m.AutopilotVersion):
            self.uid = uid_of(message)
        elif isinstance(message, Stamped):
            self.positions += 1

    def judge(self, uid: str, kind: tuple[int, int], used: "Way | None", *, is_heard: bool) -> None:
        """Decide whether this leads to the vehicle with that ``uid``, which is also at ``used``."""
        if not uid or self.uid is None or self.kind is None or self.is_another:
            return
        is_same = self.uid == uid and self.kind == kind
        if is_same and is_heard:
            if used is None or abs(self.answered_at - used.answered_at) > UNANSWERED:
                return
            (least, most), (low, high) = self.clock, used.clock
            is_same = least <= high + DRIFT and low <= most + DRIFT
        self.is_same, self.is_another = is_same, not is_same

    def is_better_than(self, used: "Way | None", used_at: float, *, now: float) -> bool:
        """Note one more packet, and ``used_at``, when the place in use brought its last.

        Return whether to use this way instead.
        """
        if used_at > self.since:
            self.since, self.news = used_at, 0
        self.news += 1
        unanswered = used is not None and self.answered_at - used.answered_at > UNANSWERED
        return unanswered or (self.news >= BRINGS and now - used_at > SILENT)

    def take_request(self) -> bool:
        """Return whether to ask something there now, with a heartbeat."""
        is_content = self.is_same and self.positions >= ENOUGH
        if is_content or self.is_another:
            self.asked = 0
        self.positions = 0
        self.asked += not is_content
        return not (is_content or self.is_another) and self.asked <= TRIES


class Ways:
    """The places of all vehicles, by system id."""

    def __init__(self) -> None:
        self._ways: dict[tuple[int, Place], Way] = {}

    def __repr__(self) -> str:
        return f"Ways({self._ways})"

    def at(self, system_id: int, place: Place, *, now: float) -> Way:
        """Return what is known about a place."""
        way = self._ways.get((system_id, place))
        if way is None:
            if len(self._ways) >= MOST:
                del self._ways[next(iter(self._ways))]
            way = self._ways[system_id, place] = Way(first_at=now)
        return way

    def look_at(self, system_id: int, place: Place) -> Way | None:
        """Return what is known about a place, or None."""
        return self._ways.get((system_id, place))

    def note_answer(self, system_id: int, place: Place, answer: m.Timesync, *, now: float) -> None:
        """Note the vehicle's answer to our TIMESYNC request."""
        way = self.at(system_id, place, now=now)
        way.answered_at = now
        way.clock = answer.tc1 / NANO - now, (answer.tc1 - answer.ts1) / NANO

    def forget(self, system_id: int) -> None:
        """Forget all places of a vehicle."""
        for key in [each for each in self._ways if each[0] == system_id]:
            del self._ways[key]
