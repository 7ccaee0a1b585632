"""The rates that we ask of a vehicle. MAVLink guide: MAV_CMD_SET_MESSAGE_INTERVAL.

An autopilot streams slowly unasked (ArduPilot SITL: 1 Hz), and forgets what was asked when it
restarts: so what comes is counted, and what comes too seldom is asked for again.
"""

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

CHECK = 3.0  # s, over which messages are counted
ENOUGH = 0.5  # of the rate asked for


class IntervalRequester:
    """Which message interval of one vehicle to ask for next: one request at a time."""

    def __init__(self, *, now: float) -> None:
        self._wanted = dict(WANTED)
        self._to_ask = dict.fromkeys(self._wanted)
        self._refused: set[int] = set()
        self._count: dict[int, int] = {}
        self._check_at = now + CHECK
        self._asked: int | None = None

    def wish(self, message_id: int, interval: float) -> None:
        """Take a client's wish for a message at least every ``interval`` seconds.

        A wish never costs the server what it needs itself: what is refused falls back to that.
        """
        interval = max(interval, SHORTEST)
        if message_id not in self._wanted and not self._has_room():
            return
        if interval < self._wanted.get(message_id, float("inf")):
            self._wanted[message_id] = interval
            self._refused.discard(message_id)
            self._to_ask[message_id] = None

    def heard(self, message_id: int) -> None:
        """Count a message of the vehicle."""
        if message_id in self._wanted:
            self._count[message_id] = self._count.get(message_id, 0) + 1

    def ask_all_again(self) -> None:
        """Begin anew, as after a restart of the vehicle."""
        self._refused.clear()
        self._to_ask.update(dict.fromkeys(self._wanted))

    def next_request(self, *, now: float) -> m.CommandLong | None:
        """Give the next request to send (its target still 0/0), or None if none is due now."""
        if now >= self._check_at:
            self._check(now)
        if self._asked is not None or not self._to_ask:
            return None
        message_id = next(iter(self._to_ask))
        del self._to_ask[message_id]
        self._asked = message_id
        interval_us = round(self._wanted[message_id] * 1e6)
        return m.CommandLong(
            0, 0, MavCmd.SET_MESSAGE_INTERVAL, 0, message_id, interval_us, 0, 0, 0, 0, 0
        )

    def answered(self, *, accepted: bool | None) -> None:
        """Take the answer to the last request: None if there was none in time."""
        asked, self._asked = self._asked, None
        if asked is None or accepted is not False:
            return
        own = WANTED.get(asked)
        if own is not None and self._wanted[asked] < own:
            self._wanted[asked] = own
            self._to_ask[asked] = None
        else:
            self._refused.add(asked)

    def next_deadline(self) -> float:
        """Give when the rates are looked at again."""
        return self._check_at

    def _has_room(self) -> bool:
        """Forget a wish that the vehicle refused, if there are too many: it may be for nothing."""
        if len(self._wanted) < MAX_WANTED:
            return True
        refused = next((i for i in self._refused if i not in WANTED), None)
        if refused is None:
            return False
        self._refused.remove(refused)
        del self._wanted[refused]
        return True

    def _check(self, now: float) -> None:
        seconds = CHECK + now - self._check_at
        for message_id, interval in self._wanted.items():
            expected = seconds / interval
            if (
                expected >= 2
                and not (message_id in OPTIONAL and not self._count.get(message_id))
                and self._count.get(message_id, 0) < ENOUGH * expected
                and message_id not in self._refused
            ):
                self._to_ask[message_id] = None
        self._count.clear()
        self._check_at = now + CHECK
