"""A vehicle's own clock, ``time_boot_ms``: how old its messages are, and whether it has restarted.

A clock that goes back means a restart, or a delayed copy of an old message. A restarted vehicle
cannot have an uptime longer than the time since it was last heard. A message that is neither news
nor a restart is dropped, so that it steers nothing.
"""

from enum import Enum, auto
from math import inf

from mav_tasks.engine.vehicles.clock_offset import ClockOffset
from mav_tasks.mavlink.messages import Attitude, GlobalPositionInt, LocalPositionNed

Stamped = Attitude | GlobalPositionInt | LocalPositionNed

OVERFLOW = 1 << 32  # ms; the field overflows after 49.7 days
#: ms behind and ahead of the expected clock, within which an overflowed clock lies: a copy may be
#: 20 s late and its original 4 s
LATEST, AHEAD = 25_000, 5_000
REBOOT = 1000  # ms that a clock must go back to mean a restart, not reordering
#: s by which a restart may seem to precede the last message before it, if delays shrink
SHRINKS = 5.0
GONE = 5.0  # s in which only older messages come: the clock before does not exist any more
ROUNDING = 0.005  # s; stamps are whole ms, and a vehicle sends several messages of one moment


class Heard(Enum):
    """The classification of a message by its time stamp."""

    NEWS = auto()
    #: older than the last message of its kind, or a copy of it
    OLD = auto()
    #: the first message after a restart
    RESTART = auto()


class SenderClock:
    """The clock of one vehicle."""

    def __init__(self) -> None:
        self.offset = ClockOffset()
        self._newest: int | None = None  # ms over all messages, counted on over overflows
        self._newest_at = 0.0  # when that message came
        self._heard_at = -inf  # when any message came
        self._latest: dict[int, int] = {}  # the newest ms by message id
        self._back_since: float | None = None  # only older messages have come since then

    def __repr__(self) -> str:
        return f"SenderClock({self._newest} ms, {self.offset!r})"

    def hear(self, message: Stamped, *, now: float) -> Heard:
        """Classify a message by its time stamp."""
        ms = self._counted_on(message.time_boot_ms, now=now)
        unheard, self._heard_at = now - self._heard_at, now
        if self._newest is not None and self._newest - ms >= REBOOT:
            return self._went_back(ms, now=now)
        if 1000 * unheard > LATEST and self._lost_time(ms, now=now):
            return Heard.RESTART  # it was silent for longer than it had been up before
        if ms <= self._latest.get(message.id, ms - 1):
            return Heard.OLD
        self._latest[message.id] = ms
        if self._newest is None or ms > self._newest:
            self._newest, self._newest_at, self._back_since = ms, now, None
        self.offset.note(now - ms / 1000, now=now)
        return Heard.NEWS

    def sent_at(self, time_boot_ms: int, *, now: float) -> float:
        """Return when a message that comes now was sent, by our clock; ``now`` if unknown."""
        made_at = self._counted_on(time_boot_ms, now=now) / 1000 + self.offset.at(now=now)
        return now if now - made_at < ROUNDING else made_at

    def booted_at(self, *, now: float) -> float:
        """Return when the vehicle booted, by our clock. Call it only after a message was heard."""
        return self.offset.at(now=now)

    def _counted_on(self, time_boot_ms: int, *, now: float) -> int:
        """Return the ms counted on over overflows of the field."""
        if self._newest is None:
            return time_boot_ms
        expected = self._expected(now)
        ahead = (time_boot_ms - expected + OVERFLOW // 2) % OVERFLOW - OVERFLOW // 2
        if -LATEST <= ahead <= AHEAD:
            return expected + ahead
        return time_boot_ms + self._newest // OVERFLOW * OVERFLOW

    def _expected(self, now: float) -> int:
        assert self._newest is not None
        return self._newest + round(1000 * (now - self._newest_at))

    def _lost_time(self, ms: int, *, now: float) -> bool:
        """Return whether the clock is far behind because the vehicle may have booted."""
        if self._newest is None or self._expected(now) - ms <= LATEST:
            return False
        return self._may_have_booted(ms % OVERFLOW / 1000, now=now)

    def _may_have_booted(self, uptime: float, *, now: float) -> bool:
        """Return whether it can have booted since the newest message was sent."""
        assert self._newest is not None
        unheard = now - self._newest / 1000 - self.offset.at(now=now)
        return 0 <= uptime <= unheard + SHRINKS

    def _went_back(self, ms: int, *, now: float) -> Heard:
        is_near = self._expected(now) - ms <= LATEST  # also if it has just overflowed
        if self._may_have_booted((ms if is_near else ms % OVERFLOW) / 1000, now=now):
            return Heard.RESTART
        if self._back_since is None:
            self._back_since = now
        return Heard.RESTART if now - self._back_since > GONE else Heard.OLD
