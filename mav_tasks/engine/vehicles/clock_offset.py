"""How far a vehicle's clock is behind ours. MAVLink guide, "Time Synchronization Protocol".

The arrival of a message less its time stamp is the offset of the clocks plus the delay. So the
least difference exceeds the offset by the delay of the quickest message. TIMESYNC gives a lower
bound: the vehicle cannot have read a request before we sent it, so the offset is at least our
sending time less the time in the answer. If the vehicle answers, the offset is taken within these
bounds. If it does not, the least difference of 20 s counts, and a delay that stays constant for
longer is not noticed.
"""

from collections import deque
from math import inf
from typing import NamedTuple

WINDOW = 20.0  # s of differences; a real clock that is off by 1e-4 drifts by 2 ms in it
BUCKET = 1.0  # s; the least difference of each bucket is kept
#: s of exchanges that count. One is made each second, in which simulators at 0.9 of real time drift
#: by 0.1 s; two in a row may be lost
EXCHANGES = 3.0
#: s; at most this much, and at most half of the quickest exchange, counts as the delay of the
#: request: that of a telemetry radio. A longer delay counts as age
WAY_THERE = 0.1
ANOTHER_CLOCK = 60.0  # s from the vehicle's other messages; not a delay, but another clock


class Exchange(NamedTuple):
    """One TIMESYNC request and its answer."""

    at: float  # s, when the answer came
    least: float  # s, lower bound of the offset at that time


class ClockOffset:
    """The offset of one vehicle's clock: our seconds less its seconds."""

    def __init__(self) -> None:
        self._buckets: deque[tuple[float, float]] = deque()  # (start, least difference) of each
        self._exchanges: deque[Exchange] = deque()
        self._quickest = inf  # s, round trip of the quickest exchange so far

    def __repr__(self) -> str:
        return f"ClockOffset({len(self._exchanges)} exchanges, quickest {self._quickest:.3f} s)"

    def note(self, difference: float, *, now: float) -> None:
        """Note by how many seconds a message came later than its time stamp."""
        buckets = self._buckets
        if not buckets or now - buckets[-1][0] >= BUCKET:
            buckets.append((now, difference))
            while now - buckets[0][0] > WINDOW:
                buckets.popleft()
        elif difference < buckets[-1][1]:
            buckets[-1] = buckets[-1][0], difference

    def exchange(self, asked_at: float, told: float, *, now: float) -> None:
        """Note the clock reading ``told``, which answers the TIMESYNC request of ``asked_at``."""
        least = asked_at - told
        if not self._buckets or abs(self._buckets[-1][1] - least) > ANOTHER_CLOCK:
            return
        self._quickest = min(self._quickest, now - asked_at)
        self._exchanges.append(Exchange(now, least))

    def at(self, *, now: float) -> float:
        """Return the offset, s, or inf before the first message."""
        exchanges = self._exchanges
        while exchanges and now - exchanges[0].at > EXCHANGES:
            exchanges.popleft()
        if not exchanges:
            return min((least for _, least in self._buckets), default=inf)
        most = max(exchange.least for exchange in exchanges) + min(self._quickest / 2, WAY_THERE)
        return min(most, self._buckets[-1][1])  # this is less if the clock has caught up since
