"""Measure this machine and print one table: each figure beside a yardstick of the same run.

Nothing is asserted: take ratios, not figures. Everything runs on loopback, bounded in count and
time. With ``--against REVISION`` a server of that revision is measured, too, by the same clients,
rovers and floods, in alternating order, so that a machine that slows down affects both alike: then
the figures are medians of the rounds, and the yardstick is that revision.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median

from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

from tests.kit.other_revision import checked_out

from . import driving, load, speed, web
from .harness import BUILD, ROOT, Row, Rows, shown

INSIDE = Path(__file__).with_name("inside.py")
HEAD = ("what", "figure", "yardstick", "ratio", "goal", "met", "")


def turns() -> Rows:
    """Calls and processor time of one TASK_MOVE in the engine, and calls of an idle wake-up."""
    return inside("calls 1 140", "calls 20 110", "calls 64 90", "idle", "cpu")


def strangers() -> Rows:
    """Memory and processor time that clients without rights cost, by endpoints × addresses."""
    return inside("strangers 1 1 1300", "strangers 64 1 300", "strangers 64 32 30")


def queue() -> Rows:
    """100,000 waiting tasks: the time to submit and take one, memory, restart; beside 1,000."""
    return inside("queue")


def simulation() -> Rows:
    """A pybullet rover with MAVLink on a circle, seconds a second; beside bare stepping."""
    return inside("simulation")


def inside(*cases: str) -> Rows:
    """Measure cases of ``inside.py``, each in a process that has nothing else."""
    for case in cases:
        said = subprocess.check_output([sys.executable, "-P", INSIDE, *case.split()], cwd=ROOT)
        yield from (Row(*cells) for cells in json.loads(said.splitlines()[-1]))


ROWS: dict[str, Callable[[], Rows]] = {
    each.__name__: each
    for each in (
        *(speed.commands, speed.durable, speed.postgres, speed.recorded, driving.stop),
        *(speed.forwarding, speed.telemetry, speed.uploads, speed.start, driving.setpoints),
        *(driving.floods, load.load, driving.gateways, driving.carrier),
        *(turns, strangers, queue, simulation, web.web),
    )
}


def main() -> None:
    """Run the measurements on the command line, or all of them."""
    listed = "\n".join(
        f"  {name:12}{(do.__doc__ or '').splitlines()[0]}" for name, do in ROWS.items()
    )
    parser = argparse.ArgumentParser(
        prog="tools/bench/run",
        description=f"{__doc__}\nrows:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("rows", nargs="*", metavar="ROWS", help="default: all")
    parser.add_argument("--against", metavar="REVISION", help="measure that revision, too")
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="with --against")
    options = parser.parse_args()
    if unknown := set(options.rows) - ROWS.keys():
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    BUILD.mkdir(exist_ok=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # ends its processes
    names = options.rows or list(ROWS)
    if options.against is None:
        return show(measured(names, ROOT))
    with checked_out(options.against) as there:
        found: dict[Path, list[Row]] = {ROOT: [], there: []}
        for number in range(options.rounds):
            for tree in (ROOT, there) if number % 2 else (there, ROOT):
                found[tree] += measured(names, tree)
    return show(compared(found[ROOT], found[there], options.against))


def measured(names: list[str], tree: Path) -> list[Row]:
    """Return the rows; one that fails is told, and leaves the others, which took minutes, too."""
    rows: list[Row] = []
    os.environ["PYTHONPATH"] = f"{tree}:{tree / 'sim'}"
    for name in names:
        print(f"{name}, {tree.name}", file=sys.stderr, flush=True)
        try:
            rows += ROWS[name]()
        except (AssertionError, OSError, ValueError, LookupError, subprocess.SubprocessError) as it:
            print(f"{name} failed: {it}", file=sys.stderr, flush=True)
    return rows


def compared(ours: Sequence[Row], theirs: Sequence[Row], revision: str) -> Rows:
    """Yield rows beside the same ones of a revision; their notes have the figures of each round."""
    for what, row in {row.what: row for row in ours}.items():
        both = [[each.figure for each in rows if each.what == what] for rows in (ours, theirs)]
        if all(both):
            here, there = map(median, both)
            note = " against ".join(" ".join(shown(it, row.unit) for it in each) for each in both)
            yield replace(row, figure=here, beside=there, of=revision, goal="", note=note)


def show(rows: Iterable[Row]) -> None:
    """Print the table, in which no cell is wrapped."""
    made = Table(*HEAD, box=MARKDOWN)
    for row in rows:
        made.add_row(*row.cells())
    Console(width=250).print(made)


if __name__ == "__main__":
    main()
