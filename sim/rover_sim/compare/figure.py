"""A figure: one number, or a few words, that describes the behaviour of a rover."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

Value = float | str | None  # None: it did not happen, or was never sent


@dataclass(frozen=True, slots=True)
class Scale:
    """Unit of a figure, and its smallest significant difference."""

    unit: str
    floor: float  # two values within ± floor are the same
    digits: int


SPEED = Scale("m/s", 0.02, 3)
NOISE = Scale("m/s", 0.01, 3)
DISTANCE = Scale("m", 0.05, 2)
WANDER = Scale("m", 0.01, 3)
TIME = Scale("s", 0.1, 2)
START_TIME = Scale("s", 0.5, 2)  # telemetry comes at 1 to 5 Hz
LATENCY = Scale("s", 0.005, 3)
ANGLE = Scale("deg", 1.0, 1)
FINE_ANGLE = Scale("deg", 0.1, 2)
YAW_RATE = Scale("deg/s", 1.0, 1)
FINE_YAW_RATE = Scale("deg/s", 0.1, 2)
SHARE = Scale("%", 5.0, 0)
PLAIN = Scale("", 0.1, 2)
COUNT = Scale("", 0.0, 0)
WORDS = Scale("", 0.0, 0)


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of one rover."""

    group: str
    name: str
    value: Value
    scale: Scale

    @property
    def key(self) -> tuple[str, str]:
        """Its key in the tables of reference values and explanations."""
        return self.group, self.name


class Group:
    """Collects the figures of one manoeuvre."""

    def __init__(self, title: str) -> None:
        self._title = title
        self.figures: list[Figure] = []

    def add(self, name: str, value: Value, scale: Scale) -> None:
        """Add one figure."""
        self.figures.append(Figure(self._title, name, value, scale))

    def add_spread(self, name: str, values: Sequence[float], scale: Scale) -> None:
        """Add the median, the 95th percentile and the largest of the values."""
        self.add(f"{name}, p50", quantile(values, 0.5), scale)
        self.add(f"{name}, p95", quantile(values, 0.95), scale)
        self.add(f"{name}, max", max(values, default=None), scale)


def quantile(values: Sequence[float], share: float) -> float | None:
    """Return the value below which ``share`` of the values lie; None if there are none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else None


def unwrapped(angles: Sequence[float]) -> list[float]:
    """Return the angles without jumps by a full turn."""
    out: list[float] = []
    for angle in angles:
        out.append(out[-1] + math.remainder(angle - out[-1], math.tau) if out else angle)
    return out


def turned(angles: Sequence[float]) -> float:
    """Return the degrees from the first angle to the last, through all between."""
    smooth = unwrapped(angles)
    return math.degrees(smooth[-1] - smooth[0])


def turned_either_way(angles: Sequence[float]) -> float:
    """Return the degrees from the first angle to the last, without the sign, which is random."""
    return abs(turned(angles))
