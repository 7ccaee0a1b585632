"""A figure beside a yardstick of the same run on the same machine, and tables of them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import quantiles
from typing import NamedTuple

SCALES = {"µs": 1e6, "ms": 1e3, "%": 1e2, "kB": 1e-3, "MB": 1e-6}  # of SI units


class Percentiles(NamedTuple):
    """Half, and 99 %, of some values are at most so large."""

    p50: float
    p99: float


def percentiles(values: Sequence[float]) -> Percentiles:
    """Return those of the values; infinity, as a lost answer is, if there are none."""
    if len(values) < 2:
        return Percentiles(*(2 * (*values, math.inf))[:2])
    cuts = quantiles(values, n=100, method="inclusive")
    return Percentiles(cuts[49], cuts[98])


@dataclass(frozen=True, slots=True)
class Row:
    """A figure, shown in ``unit``; ``beside`` is the yardstick named ``of``. Both are in SI units.

    ``goal`` is a sign, a number and ``unit``, for the figure; or with ``×``, for its ratio to the
    yardstick: "< 5 ms", "≤ 1.6×".
    """

    what: str
    figure: float
    unit: str = ""
    beside: float | None = None
    of: str = ""
    goal: str = ""
    note: str = ""

    def cells(self) -> tuple[str, ...]:
        """Return the cells of its line."""
        ratio = self.figure / self.beside if self.beside else None
        beside = "" if self.beside is None else f"{shown(self.beside, self.unit)} {self.of}"
        met = ""
        if self.goal:
            sign, number, *_ = self.goal.replace(",", "").replace("×", " ×").split()
            scaled = self.figure * SCALES.get(self.unit, 1.0)
            found = ratio if ratio and "×" in self.goal else scaled
            met = "yes" if (found >= float(number)) == (sign == "≥") else "NO"
        shown_ratio = "" if ratio is None else f"{ratio:.2f}×"
        figure = shown(self.figure, self.unit)
        return self.what, figure, beside, shown_ratio, self.goal, met, self.note


def shown(value: float, unit: str) -> str:
    """Return a value with three digits or more, and its unit."""
    scaled = value * SCALES.get(unit, 1.0)
    return f"{scaled:,.0f} {unit}" if abs(scaled) >= 100 else f"{scaled:.3g} {unit}"


def latencies(
    what: str, ours: Percentiles, beside: Percentiles, of: str, goal: str = "", unit: str = "µs"
) -> Iterator[Row]:
    """Yield the rows of p50, which has the goal, and of p99."""
    yield Row(f"{what}, p50", ours.p50, unit, beside.p50, of, goal)
    yield Row(f"{what}, p99", ours.p99, unit, beside.p99, of)


def table(rows: Sequence[Row]) -> str:
    """Return the table of one revision."""
    head = ("what", "figure", "yardstick", "ratio", "goal", "met", "")
    return _aligned([head, *(row.cells() for row in rows)])


def comparison(here: Sequence[Row], there: Sequence[Row]) -> str:
    """Return the table of two revisions: medians of the rounds, and the figures of each."""
    lines: list[tuple[str, ...]] = [
        ("what", "here", "there", "here/there", "here, all rounds", "there, all rounds")
    ]
    for what, row in {row.what: row for row in here}.items():
        ours, theirs = ([row.figure for row in rows if row.what == what] for rows in (here, there))
        if not theirs:
            continue
        medians = [sorted(each)[len(each) // 2] for each in (ours, theirs)]
        ratio = f"{medians[0] / medians[1]:.2f}" if medians[1] else ""
        rounds = (" ".join(shown(one, row.unit) for one in each) for each in (ours, theirs))
        lines.append((what, *(shown(each, row.unit) for each in medians), ratio, *rounds))
    return _aligned(lines)


def _aligned(lines: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    padded = [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in [*lines[:1], ["-" * width for width in widths], *lines[1:]]
    ]
    return "\n".join(padded)
