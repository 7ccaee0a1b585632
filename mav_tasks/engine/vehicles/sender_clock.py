"""A vehicle's own clock, ``time_boot_ms``: how old what it sends is, and whether it has restarted.

A clock that goes back is a restart, or a copy of something old that came late. They are told apart
by what a restart cannot do: say that it has been up for longer than the vehicle has been unheard.
What is neither news nor a restart is dropped, so that nothing is steered by it.
"""

from enum import Enum, auto

from mav_tasks.engine.vehicles.clock_offset import ClockOffset
from mav_tasks.mavlink.messages import Attitude, GlobalPositionInt, LocalPositionNed

Stamped = Attitude | GlobalPositionInt | LocalPositionNed

OVERFLOW = 1 << 32  # ms, the field begins anew after 49.7 days
#: ms from where a clock is to be by now, within which one that has overflowed is: a copy may be
#: 20 s late and its original 4 s
LATEST, AHEAD = 25_000, 5_000
REBOOT = 1000  # ms that a vehicle's clock must go back to mean a restart, not reordering
#: s by which a vehicle may have restarted before the last that was heard of it: delays that shrink
SHRINKS = 5.0
GONE = 5.0  # s in which nothing but what is older comes: the clock before is not there any more
ROUNDING = 0.005  # s; stamps are whole ms, and a vehicle makes several messages of one moment


class Heard(Enum):
    """What a message is, by its time."""

    NEWS = auto()
    #: older than what is known, or the same again
    OLD = auto()
    #: the first of a vehicle that has restarted
    RESTART = auto()


class SenderClock:
    """The clock of one vehicle."""

    def __init__(self) -> None:
        self.offset = ClockOffset()
        self._newest: int | None = None  # ms of all messages, counted on over overflows
        self._newest_at = 0.0  # when that came
        self._latest: dict[int, int] = {}  # the same by message id
        self._back_since: float | None = None  # only what is older has come since then

    def __repr__(self) -> str:
        return f"SenderClock({self._newest} ms, {self.offset!r})"

    def hear(self, message: Stamped, *, now: float) -> Heard:
        """Take in the time of a message."""
        ms = self._counted_on(message.time_boot_ms, now=now)
        if self._newest is not None and self._newest - ms >= REBOOT:
            return self._went_back(ms, now=now)
        if ms <= self._latest.get(message.id, ms - 1):
            return Heard.OLD
        self._latest[message.id] = ms
        if self._newest is None or ms > self._newest:
            self._newest, self._newest_at, self._back_since = ms, now, None
        self.offset.note(now - ms / 1000, now=now)
        return Heard.NEWS

    def sent_at(self, time_boot_ms: int, *, now: float) -> float:
        """Return when what comes now was made, by our clock: now, if nothing tells."""
        made_at = self._counted_on(time_boot_ms, now=now) / 1000 + self.offset.at(now=now)
        return now if now - made_at < ROUNDING else made_at

    def booted_at(self, *, now: float) -> float:
        """Return when the vehicle was started, by our clock; a message must have been heard."""
        return self.offset.at(now=now)

    def _counted_on(self, time_boot_ms: int, *, now: float) -> int:
        """Return ms that do not begin anew where the field overflows."""
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

    def _went_back(self, ms: int, *, now: float) -> Heard:
        assert self._newest is not None
        is_near = self._expected(now) - ms <= LATEST  # also where it has just overflowed
        uptime = (ms if is_near else ms % OVERFLOW) / 1000
        unheard = now - self._newest / 1000 - self.offset.at(now=now)
        if 0 <= uptime <= unheard + SHRINKS:
            return Heard.RESTART
        if self._back_since is None:
            self._back_since = now
        return Heard.RESTART if now - self._back_since > GONE else Heard.OLD
