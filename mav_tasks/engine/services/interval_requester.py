"""The rates that we ask of a vehicle. MAVLink guide: MAV_CMD_SET_MESSAGE_INTERVAL.

An autopilot streams slowly unasked (ArduPilot SITL: 1 Hz), and forgets what was asked when it
restarts: so what comes is counted, and what comes too seldom is asked for again. What clients wish
beyond our own needs is given as a whole, again and again, and goes back when nobody wishes it.
"""

from collections.abc import Mapping
from math import inf

from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.services.token_bucket import TokenBucket
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd

#: What the server needs or shows, seconds between messages.
WANTED: dict[int, float] = {
    m.LocalPositionNed.id: 0.04,
    m.Attitude.id: 0.04,
    m.GlobalPositionInt.id: 0.2,
    m.VfrHud.id: 0.25,
    m.SysStatus.id: 1.0,
    m.ExtendedSysState.id: 1.0,
    m.GpsRawInt.id: 0.5,
    m.BatteryStatus.id: 1.0,
    m.SystemTime.id: 1.0,
    m.HomePosition.id: 2.0,
    m.MissionCurrent.id: 1.0,
    m.RcChannels.id: 0.1,  # sticks that leave neutral
}

#: what some vehicles have nothing to say in: asked for once, and again only if it has come
OPTIONAL = frozenset({m.RcChannels.id})

SHORTEST = 0.02  # s: what a vehicle's main loop can give; a shorter one is refused altogether
MAX_WANTED = 64  # messages; clients can name more ids than any vehicle has

DEFAULT = 0.0  # s: as often as the vehicle itself likes
NEVER = inf  # s: what is not asked for may not come at all
MAX_REFUSED = 256  # messages of which it is known that the vehicle has none

CHECK = 3.0  # s, over which messages are counted
ENOUGH = 0.5  # of the rate asked for

#: for clients' wishes so many requests at once, and one a second: with its answer each costs 66
#: bytes of a radio, which a client that changes its wishes all the time must not fill
CHANGES_AT_ONCE, CHANGES = 16.0, 1.0
TRIES = 3  # to have something come less often again, of a vehicle that does not answer


class IntervalRequester:
    """Which message interval of one vehicle to ask for next: one request at a time."""

    def __init__(self, *, now: float) -> None:
        self._wanted = dict(WANTED)
        self._needed = dict.fromkeys(WANTED)  # to be asked for, for ourselves
        self._changed: dict[int, None] = {}  # to be asked for, as clients wish
        self._changes = TokenBucket(rate=CHANGES, burst=CHANGES_AT_ONCE, now=now)
        self._tries: dict[int, int] = {}  # left, of what is to come less often
        self._refused: dict[int, float] = {}  # the longest interval refused, by message
        self._count: dict[int, int] = {}
        #: s, when the rates are looked at again
        self.check_at = now + CHECK
        self._asked: int | None = None

    def set_wishes(self, wishes: Mapping[int, float]) -> None:
        """Take what clients wish now, all together: seconds between messages, by message id.

        A wish never costs the server what it needs itself: what is refused falls back to that.
        """
        wanted = dict(WANTED)
        for number, wish in wishes.items():
            interval = max(wish, SHORTEST)
            is_refused = interval <= self._refused.get(number, 0.0)
            has_room = number in wanted or len(wanted) < MAX_WANTED
            if not is_refused and has_room and interval < wanted.get(number, NEVER):
                wanted[number] = interval
        for number in {**self._wanted, **wanted}:
            before, after = self._wanted.get(number, NEVER), wanted.get(number, NEVER)
            if after > before:
                self._tries[number] = TRIES
            if after != before:
                self._changed[number] = None
        self._wanted = wanted

    def heard(self, message_id: int) -> None:
        """Count a message of the vehicle."""
        if message_id in self._wanted:
            self._count[message_id] = self._count.get(message_id, 0) + 1

    def ask_all_again(self) -> None:
        """Begin anew, as after a restart of the vehicle."""
        self._refused.clear()
        self._needed.update(dict.fromkeys(WANTED))
        self._changed.update((number, None) for number in self._wanted if number not in WANTED)

    def next_request(self, *, now: float) -> m.CommandLong | None:
        """Return the next request to send (its target still 0/0), or None if none is due now."""
        if now >= self.check_at:
            self._check(now)
        if self._asked is not None:
            return None
        if self._needed:
            message_id = next(iter(self._needed))
        elif self._changed and self._changes.take(now=now):
            message_id = next(iter(self._changed))
        else:
            return None
        self._needed.pop(message_id, None)
        self._changed.pop(message_id, None)
        self._asked = message_id
        interval_us = round(self._wanted.get(message_id, DEFAULT) * 1e6)
        return m.CommandLong(
            0, 0, MavCmd.SET_MESSAGE_INTERVAL, 0, message_id, interval_us, 0, 0, 0, 0, 0
        )

    def answered(self, *, accepted: bool | None) -> None:
        """Take the answer to the last request: None if there was none in time."""
        asked, self._asked = self._asked, None
        if asked is None:
            return
        tries = self._tries.pop(asked, 0)
        if accepted is None and tries:
            self._tries[asked] = tries - 1
            self._changed[asked] = None
        interval = self._wanted.get(asked)
        if accepted is not False or interval is None:
            return
        least = max(interval, self._refused.get(asked, 0.0))
        keep_latest(self._refused, asked, least, most=MAX_REFUSED)
        own = WANTED.get(asked)
        if own is None:
            del self._wanted[asked]
        elif interval < own:
            self._wanted[asked] = own
            self._needed[asked] = None

    def _check(self, now: float) -> None:
        seconds = CHECK + now - self.check_at
        for message_id, interval in self._wanted.items():
            expected = seconds / interval
            if (
                expected >= 2
                and not (message_id in OPTIONAL and not self._count.get(message_id))
                and self._count.get(message_id, 0) < ENOUGH * expected
                and interval > self._refused.get(message_id, 0.0)
            ):
                pile = self._needed if message_id in WANTED else self._changed
                pile[message_id] = None
        self._count.clear()
        self.check_at = now + CHECK
