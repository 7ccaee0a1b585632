"""How far a vehicle's clock is behind ours. MAVLink guide, "Time Synchronization Protocol".

What comes is never younger than it looks: the least difference between when messages came and when
they say that they were made is the offset of the clocks and the delay of the quickest of them. How
much of that is delay an exchange of TIMESYNC tells: what was asked cannot have been read before it
was asked, so the offset is at least the difference from the asking to the vehicle's answer. Who
answers is believed within that; of who does not, the least difference of 20 s counts, and a delay
that does not change for longer than that is not seen.
"""

from collections import deque
from math import inf
from typing import NamedTuple

WINDOW = 20.0  # s, of differences; a real clock of 1e-4 goes wrong by 2 ms in it
BUCKET = 1.0  # s, of which the least difference is kept
#: s, of exchanges; one is made each second, in which simulators at 0.9 of real time go wrong by
#: 0.1 s, and two in a row may be lost
EXCHANGES = 3.0
#: s of the quickest exchange that are taken for the way there, at the most half of it: the way
#: there of a telemetry radio; what more it takes is counted as age
WAY_THERE = 0.1
ANOTHER_CLOCK = 60.0  # s from what the vehicle says elsewhere; not a delay, but another clock


class Exchange(NamedTuple):
    """One question for the time, and its answer."""

    at: float  # when it was answered
    least: float  # s, what the offset was then, at the least


class ClockOffset:
    """The offset of one vehicle's clock: our seconds less its own."""

    def __init__(self) -> None:
        self._buckets: deque[tuple[float, float]] = deque()  # from when, and the least since
        self._exchanges: deque[Exchange] = deque()
        self._quickest = inf  # s, of all exchanges

    def __repr__(self) -> str:
        return f"ClockOffset({len(self._exchanges)} exchanges, quickest {self._quickest:.3f} s)"

    def note(self, difference: float, *, now: float) -> None:
        """Take in by how many seconds a message came later than it says that it was made."""
        buckets = self._buckets
        if not buckets or now - buckets[-1][0] >= BUCKET:
            buckets.append((now, difference))
            while now - buckets[0][0] > WINDOW:
                buckets.popleft()
        elif difference < buckets[-1][1]:
            buckets[-1] = buckets[-1][0], difference

    def exchange(self, asked_at: float, told: float, *, now: float) -> None:
        """Take in what it said its clock was, when it was asked for that."""
        least = asked_at - told
        if not self._buckets or abs(self._buckets[-1][1] - least) > ANOTHER_CLOCK:
            return
        self._quickest = min(self._quickest, now - asked_at)
        self._exchanges.append(Exchange(now, least))

    def at(self, *, now: float) -> float:
        """Return the offset, or inf before the first message."""
        exchanges = self._exchanges
        while exchanges and now - exchanges[0].at > EXCHANGES:
            exchanges.popleft()
        if not exchanges:
            return min((least for _, least in self._buckets), default=inf)
        most = max(exchange.least for exchange in exchanges) + min(self._quickest / 2, WAY_THERE)
        return min(most, self._buckets[-1][1])  # less where the clock has caught up since
