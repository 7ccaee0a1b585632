"""A histogram of fixed size: counts by bucket, cheap enough for each setpoint. Pure."""

from bisect import bisect_left
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Distribution:
    """The figures of a histogram at one moment.

    ``counts[i]`` values were at most ``bounds[i]`` and more than the bound before; the last of the
    ``counts``, one more than there are bounds, were above all of them.
    """

    bounds: tuple[float, ...]
    counts: tuple[int, ...]
    total: float  # sum of all values

    @property
    def count(self) -> int:
        """Number of values."""
        return sum(self.counts)


class Histogram:
    """Counts values by bucket. One thread uses it; others get its figures as a Distribution."""

    def __init__(self, bounds: tuple[float, ...]) -> None:
        """``bounds``: the upper bounds of the buckets, which include them, in ascending order."""
        self._bounds = bounds
        self._counts = [0] * (len(bounds) + 1)
        self._total = 0.0

    def __repr__(self) -> str:
        return f"Histogram({sum(self._counts)} values)"

    def note(self, value: float) -> None:
        self._counts[bisect_left(self._bounds, value)] += 1
        self._total += value

    def figures(self) -> Distribution:
        return Distribution(self._bounds, tuple(self._counts), self._total)
