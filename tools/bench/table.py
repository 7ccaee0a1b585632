"""The one table that a run of the benchmarks prints."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One figure beside its yardstick, measured in the same run on the same machine.

    ``met`` is None where there is no goal.
    """

    what: str
    figure: str
    yardstick: str
    ratio: str
    goal: str
    met: bool | None


HEAD = ("what", "figure", "yardstick", "ratio", "goal", "met")


def render(rows: Sequence[Row]) -> str:
    """Give the table as text, columns aligned."""
    verdict = {True: "yes", False: "NO", None: ""}
    cells = [HEAD] + [
        (row.what, row.figure, row.yardstick, row.ratio, row.goal, verdict[row.met]) for row in rows
    ]
    widths = [max(len(line[column]) for line in cells) for column in range(len(HEAD))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(c, widths, strict=True)) for c in cells]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join(line.rstrip() for line in lines)
