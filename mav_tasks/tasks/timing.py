"""How evenly the setpoints of a task left: the intervals between one and the next.

Measured with the time at which the engine gives a setpoint, the ``now`` of that turn. The loop
reads it when it gets to the turn, so a timer that fires late, a process that was stopped and an
earlier turn that took long are in the figures; what comes after (the rest of the turn, the kernel,
the net) is not. Only while a task is EXECUTING: an interval never reaches over a pause.
"""

from dataclasses import dataclass, replace
from math import ceil

FINE = 1e-4  # s, the resolution of the percentiles up to
FINE_END = 0.2  # s
COARSE = 1e-2  # s, the same from there on up to
COARSE_END = 10.0  # s; what is longer is counted together, and the longest is exact anyway
_FINE_BUCKETS = round(FINE_END / FINE)
_PER_FINE, _PER_COARSE = 1 / FINE, 1 / COARSE

LATE = 1.5  # periods: a longer interval means that a setpoint was half a period late, or left out


@dataclass(frozen=True, slots=True)
class Timing:
    """Figures of ``count`` intervals. ``period`` is the one asked for; all of them seconds.

    ``p50`` and ``p99`` are rounded to FINE or COARSE, ``longest`` is exact; ``late`` of the
    intervals were longer than LATE periods. ``spread`` is how many there were of each length,
    bucket and number in turns: with it a task that is not over is gone on with, also after a
    restart.
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

    @property
    def final(self) -> "Timing":
        """The same of a task that is over: nothing will be added."""
        return replace(self, spread=())


class TimingMeter:
    """Takes the intervals of one task. Its memory has a bound, however long the task drives."""

    def __init__(self, *, period: float, before: Timing | None = None) -> None:
        """``before``: what is known of the task already, with its spread."""
        self._period = period
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
        """A setpoint leaves now; the first one begins an interval and ends none."""
        last, self._last = self._last, now
        if last is None:
            return
        interval = now - last
        bucket = (
            int(interval * _PER_FINE + 0.5) if interval < FINE_END else _coarse_bucket(interval)
        )
        self._counts[bucket] = self._counts.get(bucket, 0) + 1
        if interval > self._longest:
            self._longest = interval
        if interval > self._late_after:
            self._late += 1

    def timing(self) -> Timing | None:
        """Return the figures so far, None while there is no interval."""
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
        """Return the length below or at which ``rank`` of the intervals are."""
        seen = 0
        for bucket, number in spread:
            seen += number
            if seen >= rank:
                return min(_length_of(bucket), self._longest)
        raise AssertionError("a rank is at most the number of intervals")


def _coarse_bucket(interval: float) -> int:
    return _FINE_BUCKETS + int((min(interval, COARSE_END) - FINE_END) * _PER_COARSE + 0.5)


def _length_of(bucket: int) -> float:
    if bucket <= _FINE_BUCKETS:
        return bucket * FINE
    return FINE_END + (bucket - _FINE_BUCKETS) * COARSE
