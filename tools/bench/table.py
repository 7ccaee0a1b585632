"""The table of a benchmark run."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One figure with its yardstick, measured in the same run on the same machine.

    ``met`` is None without a goal.
    """

    what: str
    figure: str
    yardstick: str
    ratio: str
    goal: str
    met: bool | None


HEAD = ("what", "figure", "yardstick", "ratio", "goal", "met")


def render(rows: Sequence[Row]) -> str:
    """Return the table as text, columns aligned."""
    verdict = {True: "yes", False: "NO", None: ""}
    cells = [HEAD] + [
        (row.what, row.figure, row.yardstick, row.ratio, row.goal, verdict[row.met]) for row in rows
    ]
    return aligned(cells)


def aligned(cells: Sequence[Sequence[str]]) -> str:
    """Return cells as text, columns aligned, with a line under the first row."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(c, widths, strict=True)) for c in cells]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join(line.rstrip() for line in lines)
