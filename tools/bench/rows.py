"""A figure beside a yardstick of the same run on the same machine, and tables of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median, quantiles
from typing import NamedTuple

from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

SCALES = {"µs": 1e6, "ms": 1e3, "%": 1e2, "kB": 1e-3, "MB": 1e-6}  # of SI units
WIDTH = 250  # characters of a table, so that no cell is wrapped


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


def show(rows: Sequence[Row]) -> None:
    """Print the table of one revision."""
    made = Table("what", "figure", "yardstick", "ratio", "goal", "met", "", box=MARKDOWN)
    for row in rows:
        made.add_row(*row.cells())
    Console(width=WIDTH).print(made)


def compare(here: Sequence[Row], there: Sequence[Row]) -> None:
    """Print the table of two revisions: medians of the rounds, and the figures of each."""
    head = "what", "here", "there", "here/there", "here, all rounds", "there, all rounds"
    made = Table(*head, box=MARKDOWN)
    for what, unit in {row.what: row.unit for row in here}.items():
        both = [[row.figure for row in rows if row.what == what] for rows in (here, there)]
        if all(both):
            ours, theirs = map(median, both)
            ratio = f"{ours / theirs:.2f}" if theirs else ""
            rounds = (" ".join(shown(one, unit) for one in each) for each in both)
            made.add_row(what, shown(ours, unit), shown(theirs, unit), ratio, *rounds)
    Console(width=WIDTH).print(made)
