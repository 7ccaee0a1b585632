"""A vehicle's own clock, ``time_boot_ms``: how old its messages are, and whether it has restarted.

A clock that goes back means a restart, or a delayed copy of an old message. A restarted vehicle
cannot have an uptime longer than the time since it was last heard. A message that is neither news
nor a restart is dropped, so that it steers nothing.

How far that clock is behind ours: MAVLink guide, "Time Synchronization Protocol". The arrival of a
message less its time stamp is the offset of the clocks plus the delay. So the least difference
exceeds the offset by the delay of the quickest message. TIMESYNC gives a lower bound: the vehicle
cannot have read a request before we sent it, so the offset is at least our sending time less the
time in the answer. If the vehicle answers, the offset is taken within these bounds. If it does not,
the least difference of 20 s counts, and a delay that stays constant for longer is not noticed.
"""

from collections import deque
from collections.abc import Callable
from enum import Enum, auto
from math import inf
from operator import itemgetter

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
WINDOW = 20.0  # s of differences; a real clock that is off by 1e-4 drifts by 2 ms in it
BUCKET = 1.0  # s; the least difference of each bucket is kept
#: s of exchanges that count. One is made each second, in which simulators at 0.9 of real time drift
#: by 0.1 s; two in a row may be lost
EXCHANGES = 3.0
#: s; at most this much, and at most half of the quickest exchange, counts as the delay of the
#: request: that of a telemetry radio. A longer delay counts as age
WAY_THERE = 0.1
ANOTHER_CLOCK = 60.0  # s from the vehicle's other messages; not a delay, but another clock


_value: Callable[[tuple[float, float]], float] = itemgetter(1)


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
        self._newest = -1  # ms over all messages, counted on over overflows
        self._newest_at = 0.0  # when that message came
        self._heard_at = -inf  # when any message came
        self._latest: dict[int, int] = {}  # the newest ms by message id; empty: none came
        self._back_since = inf  # only older messages have come since then
        self._differences: deque[tuple[float, float]] = deque()  # (start, least) of each bucket
        self._least = inf  # of all buckets
        self._exchanges: deque[tuple[float, float]] = deque()  # (end, lower bound of the offset)
        self._quickest = inf  # s, round trip of the quickest exchange so far
        #: s by our clock: when the vehicle booted, by the last news, and when that news was sent
        self.booted = self.news_at = inf

    def __repr__(self) -> str:
        return f"SenderClock({self._newest} ms, quickest exchange {self._quickest:.3f} s)"

    def hear(self, message: Stamped, *, now: float) -> Heard:
        """Classify a message by its time stamp."""
        ms = self._counted_on(message.time_boot_ms, now=now)
        unheard, self._heard_at = now - self._heard_at, now
        if self._newest - ms >= REBOOT:
            return self._went_back(ms, now=now)
        if (
            1000 * unheard > LATEST
            and self._latest
            and self._expected(now) - ms > LATEST
            and self._may_have_booted(ms % OVERFLOW / 1000, now=now)
        ):
            return Heard.RESTART  # it was silent for longer than it had been up before
        if ms <= self._latest.get(message.id, ms - 1):
            return Heard.OLD
        self._latest[message.id] = ms
        if ms > self._newest:
            self._newest, self._newest_at, self._back_since = ms, now, inf
        self._note_difference(now - ms / 1000, now=now)
        self.booted = self.booted_at(now=now)
        self.news_at = _made_at(ms, self.booted, now=now)
        return Heard.NEWS

    def exchange(self, asked_at: float, told: float, *, now: float) -> None:
        """Note the clock reading ``told``, which answers the TIMESYNC request of ``asked_at``."""
        least = asked_at - told
        if self._differences and abs(self._differences[-1][1] - least) <= ANOTHER_CLOCK:
            self._quickest = min(self._quickest, now - asked_at)
            self._exchanges.append((now, least))

    def sent_at(self, time_boot_ms: int, *, now: float) -> float:
        """Return when a message that comes now was sent, by our clock; ``now`` if unknown."""
        return _made_at(self._counted_on(time_boot_ms, now=now), self.booted_at(now=now), now=now)

    def booted_at(self, *, now: float) -> float:
        """Return when the vehicle booted, by our clock: our seconds less its seconds.

        It is inf before the first message.
        """
        exchanges = self._exchanges
        while exchanges and now - exchanges[0][0] > EXCHANGES:
            exchanges.popleft()
        if not exchanges:
            return self._least
        most = max(map(_value, exchanges)) + min(self._quickest / 2, WAY_THERE)
        return min(most, self._differences[-1][1])  # less if the clock has caught up since

    def _note_difference(self, difference: float, *, now: float) -> None:
        """Note by how many seconds a message came later than its time stamp."""
        buckets = self._differences
        if not buckets or now - buckets[-1][0] >= BUCKET:
            buckets.append((now, difference))
            while now - buckets[0][0] > WINDOW:
                buckets.popleft()
            self._least = min(map(_value, buckets))
        elif difference < buckets[-1][1]:
            buckets[-1] = buckets[-1][0], difference
            self._least = min(self._least, difference)

    def _counted_on(self, time_boot_ms: int, *, now: float) -> int:
        """Return the ms counted on over overflows of the field."""
        if not self._latest:
            return time_boot_ms
        expected = self._expected(now)
        ahead = (time_boot_ms - expected + OVERFLOW // 2) % OVERFLOW - OVERFLOW // 2
        if -LATEST <= ahead <= AHEAD:
            return expected + ahead
        return time_boot_ms + self._newest // OVERFLOW * OVERFLOW

    def _expected(self, now: float) -> int:
        return self._newest + round(1000 * (now - self._newest_at))

    def _may_have_booted(self, uptime: float, *, now: float) -> bool:
        """Return whether it can have booted since the newest message was sent."""
        unheard = now - self._newest / 1000 - self.booted_at(now=now)
        return 0 <= uptime <= unheard + SHRINKS

    def _went_back(self, ms: int, *, now: float) -> Heard:
        is_near = self._expected(now) - ms <= LATEST  # also if it has just overflowed
        if self._may_have_booted((ms if is_near else ms % OVERFLOW) / 1000, now=now):
            return Heard.RESTART
        self._back_since = min(self._back_since, now)
        return Heard.RESTART if now - self._back_since > GONE else Heard.OLD


def _made_at(ms: int, booted_at: float, *, now: float) -> float:
    """Return when a message of that time stamp was made; ``now`` if ROUNDING may be all."""
    made_at = ms / 1000 + booted_at
    return now if now - made_at < ROUNDING else made_at
