"""Setpoint timing of a task: the intervals between one setpoint and the next.

A setpoint's time is the engine's ``now`` in the turn that returns it. The loop reads the clock at
the start of a turn. Hence the figures include a late timer, a stopped process and a long earlier
turn. They exclude what follows: the rest of the turn, the kernel, the network. Only EXECUTING
counts: no interval spans a pause.
"""

from bisect import bisect_left
from dataclasses import dataclass
from itertools import accumulate
from math import ceil

from mav_tasks.basics.histogram import Histogram

FINE = 1e-4  # s, resolution of the percentiles up to FINE_END
FINE_END = 0.2  # s
COARSE = 1e-2  # s, resolution from there up to COARSE_END
COARSE_END = 10.0  # s; longer intervals are counted together, and the longest is exact anyway
_FINE_BUCKETS = round(FINE_END / FINE)
_PER_FINE, _PER_COARSE = 1 / FINE, 1 / COARSE

#: s, bounds of the histogram over all tasks of a vehicle; setpoints come every 0.02 to 0.2 s
INTERVALS = (
    *(0.01, 0.02, 0.03, 0.04, 0.045, 0.049, 0.051, 0.055, 0.06, 0.075),
    *(0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0),
)

LATE = 1.5  # periods; a longer interval means a setpoint half a period late, or left out


@dataclass(frozen=True, slots=True)
class Timing:
    """Statistics of ``count`` intervals. ``period`` is the nominal one; all times in seconds.

    ``p50`` and ``p99`` are rounded to FINE or COARSE, ``longest`` is exact. ``late`` intervals were
    longer than LATE periods. ``spread`` is the histogram: bucket and number in turns. With it the
    statistics of an unfinished task continue, also after a restart.
    """

    period: float
    count: int
    p50: float
    p99: float
    longest: float
    late: int
    spread: tuple[int, ...] = ()

    def __str__(self) -> str:
        return (
            f"{self.count} setpoints at {1 / self.period:g} Hz: p50 {self.p50 * 1e3:.1f},"
            f" p99 {self.p99 * 1e3:.1f}, max {self.longest * 1e3:.1f} ms, {self.late} late"
        )


class TimingMeter:
    """Meter of one task's intervals. Its memory is bounded, however long the task drives."""

    def __init__(self, *, period: float, every: Histogram, before: Timing | None = None) -> None:
        """``before`` is the timing of the task so far, with its spread.

        ``every`` counts the intervals of all tasks of the vehicle.
        """
        self._period = period
        self._every = every
        self._late_after = LATE * period
        self._counts: dict[int, int] = {}  # by bucket
        self._late = 0
        self._longest = 0.0
        self._last: float | None = None
        if before is not None:
            self._counts.update(zip(before.spread[::2], before.spread[1::2], strict=True))
            self._late, self._longest = before.late, before.longest

    def __repr__(self) -> str:
        return f"TimingMeter({self.timing()})"

    def note(self, *, now: float) -> None:
        """Note that a setpoint is sent now; the first one only begins an interval."""
        last, self._last = self._last, now
        if last is None:
            return
        interval = now - last
        if interval < FINE_END:
            bucket = int(interval * _PER_FINE + 0.5)
        else:
            beyond = min(interval, COARSE_END) - FINE_END
            bucket = _FINE_BUCKETS + int(beyond * _PER_COARSE + 0.5)
        self._counts[bucket] = self._counts.get(bucket, 0) + 1
        self._every.note(interval)
        if interval > self._longest:
            self._longest = interval
        if interval > self._late_after:
            self._late += 1

    def timing(self) -> Timing | None:
        """Return the statistics so far, None without an interval."""
        spread = sorted(self._counts.items())
        count = sum(number for _, number in spread)
        if not count:
            return None
        return Timing(
            period=self._period,
            count=count,
            p50=self._percentile(spread, ceil(0.5 * count)),
            p99=self._percentile(spread, ceil(0.99 * count)),
            longest=self._longest,
            late=self._late,
            spread=tuple(part for pair in spread for part in pair),
        )

    def _percentile(self, spread: list[tuple[int, int]], rank: int) -> float:
        """Return the length that ``rank`` of the intervals do not exceed."""
        buckets, numbers = zip(*spread, strict=True)
        found = bisect_left(list(accumulate(numbers)), rank)  # at most the last one
        return min(_length_of(buckets[found]), self._longest)


def _length_of(bucket: int) -> float:
    if bucket <= _FINE_BUCKETS:
        return bucket * FINE
    return FINE_END + (bucket - _FINE_BUCKETS) * COARSE
