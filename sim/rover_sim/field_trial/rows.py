"""The rows of the table: request, result, figure, limit."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """The verdict on a row."""

    PASS = "PASS"
    FAIL = "FAIL"
    NOT_TRIED = "NOT TRIED"


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table."""

    name: str
    asked: str
    result: str
    figure: str
    limit: str
    verdict: Verdict


def judged(
    name: str, asked: str, *, result: str, figure: str = "", limit: str = "", holds: bool
) -> Row:
    """Return a row that was tried."""
    verdict = Verdict.PASS if holds else Verdict.FAIL
    return Row(name, asked, result, figure, limit, verdict)


def not_tried(name: str, asked: str, why: str) -> Row:
    """Return a row that was not tried, with the reason."""
    return Row(name, asked, why, "", "", Verdict.NOT_TRIED)


def table(rows: Sequence[Row]) -> list[str]:
    """Return the table as lines, with columns of minimal width."""
    head = ("row", "asked", "result", "figure", "limit", "verdict")
    cells = [head] + [(r.name, r.asked, r.result, r.figure, r.limit, r.verdict.value) for r in rows]
    widths = [max(len(line[n]) for line in cells) for n in range(len(head))]
    return [
        "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in cells
    ]


def quantile(values: Sequence[float], share: float) -> float:
    """Return the value at or below which ``share`` of the values lie; 0 without values."""
    ordered = sorted(values)
    if not ordered:
        return 0.0
    return ordered[min(len(ordered) - 1, max(0, -(-len(ordered) * int(share * 100) // 100) - 1))]
