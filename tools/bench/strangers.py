"""What strangers cost: memory that stays and CPU time, compared with another revision.

``strangers_child`` defines what they send. They are observers: they may ask, and stop a rover.
"""

import os
import subprocess
import sys
from pathlib import Path

from tests.kit.other_revision import checked_out

from .child import ROOT
from .table import Row

CHILD = Path(__file__).with_name("strangers_child.py")
BEFORE = "04b23ba7"  # the revision that looked at rights last
#: endpoints, addresses at each of them, packets from each
CASES = ((1, 1, 1300), (64, 1, 300), (64, 32, 30))
GOAL = 64e3  # bytes for each endpoint


def measure(against: str = BEFORE) -> list[Row]:
    """Return the rows of memory and of CPU time for each case."""
    with checked_out(against) as tree:
        return [row for case in CASES for row in _rows(case, tree, against[:8])]


def _rows(case: tuple[int, int, int], tree: Path, against: str) -> list[Row]:
    endpoints, addresses, packets = case
    what = f"strangers, {endpoints} × {addresses} addresses, {packets} packets each"
    ours, theirs = (_asked(each, "bytes", case) for each in (ROOT, tree))
    cpu, their_cpu = (_asked(each, "seconds", case) for each in (ROOT, tree))
    return [
        Row(
            f"{what}: memory",
            f"{ours / 1e3:.0f} kB",
            f"{theirs / 1e3:.0f} kB {against}",
            f"{theirs / ours:.0f}× less",
            f"< {GOAL / 1e3:.0f} kB per endpoint",
            ours < GOAL * endpoints,
        ),
        Row(
            f"{what}: processor, each",
            f"{cpu * 1e6:.0f} µs",
            f"{their_cpu * 1e6:.0f} µs {against}",
            f"{cpu / their_cpu:.2f}×",
            "",
            None,
        ),
    ]


def _asked(tree: Path, what: str, case: tuple[int, int, int]) -> float:
    """Run the child on the modules of a tree, and return what it prints."""
    ended = subprocess.run(
        [sys.executable, "-P", str(CHILD), what, *map(str, case)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": "0"},
    )
    return float(ended.stdout)
