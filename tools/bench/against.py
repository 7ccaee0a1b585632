"""The same measurements of this server and of another revision's, alternating in one run.

Clients, floods and simulated rovers are this revision's for both: only the server differs. Each
measurement is repeated in alternating order, so that a machine that slows down affects both alike.
The median of each figure counts.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from tests.kit.other_revision import checked_out

from . import table
from .child import ROOT, SERVER_FROM

NUMBER = re.compile(r"-?[\d,]*\.?\d+")
HEAD = ("what", "here", "there", "here/there", "here, all rounds", "there, all rounds")


@dataclass(frozen=True, slots=True)
class Pair:
    """One figure of both servers, one value per round."""

    what: str
    unit: str
    here: tuple[float, ...]
    there: tuple[float, ...]


def measure(revision: str, names: Sequence[str], *, rounds: int) -> list[Pair]:
    """Return the figures of each measurement for both servers."""
    pairs: list[Pair] = []
    with checked_out(revision) as tree:
        for name in names:
            figures: dict[Path, list[dict[str, str]]] = {ROOT: [], tree: []}
            try:
                for number in range(rounds):
                    for each in (ROOT, tree) if number % 2 else (tree, ROOT):
                        figures[each].append(_figures(name, each))
            except subprocess.CalledProcessError as error:  # the other figures took minutes, too
                print(f"{name} failed: {error}", file=sys.stderr, flush=True)
                continue
            pairs += _paired(figures[ROOT], figures[tree])
    return pairs


def render(pairs: Sequence[Pair]) -> str:
    """Return the table as text."""
    return table.aligned([HEAD, *map(_cells, pairs)])


def _figures(name: str, tree: Path) -> dict[str, str]:
    """Run one measurement in its own process; return its figures by name."""
    print(f"{name}: {'here' if tree == ROOT else 'there'}", file=sys.stderr, flush=True)
    ended = subprocess.run(
        [sys.executable, "-m", "tools.bench", "--json", name],
        cwd=ROOT,
        env={**os.environ, SERVER_FROM: str(tree)},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    rows = json.loads(ended.stdout.splitlines()[-1])
    return {row["what"]: row["figure"] for row in rows}


def _paired(here: Sequence[dict[str, str]], there: Sequence[dict[str, str]]) -> list[Pair]:
    return [
        Pair(what, _unit(figure), _numbers(here, what), _numbers(there, what))
        for what, figure in here[0].items()
        if NUMBER.search(figure)
    ]


def _numbers(rounds: Sequence[dict[str, str]], what: str) -> tuple[float, ...]:
    found = (NUMBER.search(figures[what]) for figures in rounds)
    return tuple(float(number[0].replace(",", "")) for number in found if number is not None)


def _unit(figure: str) -> str:
    """Return the text behind the first number, up to a comma."""
    behind = NUMBER.split(figure, maxsplit=1)[1]
    return behind.partition(",")[0].strip()


def _cells(pair: Pair) -> tuple[str, ...]:
    here, there = median(pair.here), median(pair.there)
    return (
        pair.what,
        f"{here:,g} {pair.unit}",
        f"{there:,g} {pair.unit}",
        f"{here / there:.2f}" if there else "",
        " ".join(f"{each:g}" for each in pair.here),
        " ".join(f"{each:g}" for each in pair.there),
    )
