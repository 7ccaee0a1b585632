"""Measure this machine and print one table: each figure beside a yardstick of the same run.

Nothing is asserted: take ratios, not figures. Everything runs on loopback, bounded in count and
time. With ``--against REVISION`` a server of that revision is measured, too, by the same clients,
rovers and floods, in alternating order, so that a machine that slows down affects both alike.
"""

import argparse
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.kit.other_revision import checked_out

from . import driving, engine, fleet, floods, load, speed, uploads, web
from .processes import BUILD, ROOT
from .rows import Row, compare, show

#: of a server or an engine, which may be another revision's
MEASUREMENTS: dict[str, Callable[[Path], Iterator[Row]]] = {
    "commands": speed.commands,
    "durable": speed.durable,
    "postgres": speed.postgres,
    "recorded": speed.recorded,
    "stop": floods.stop,
    "forwarding": speed.forwarding,
    "telemetry": speed.telemetry,
    "uploads": uploads.measure,
    "start": speed.start,
    "setpoints": driving.measure,
    "floods": floods.measure,
    "load": load.measure,
    "gateways": driving.fleets,
    "carrier": fleet.measure,
    "turns": engine.turns,
    "strangers": engine.strangers,
    "queue": engine.queue,
    "simulation": engine.simulation,
    "web": web.measure,
}


def main() -> None:
    """Run the measurements on the command line, or all of them."""
    listed = "\n".join(
        f"  {name:12}{(do.__doc__ or '').splitlines()[0]}" for name, do in MEASUREMENTS.items()
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
    if unknown := set(options.rows) - MEASUREMENTS.keys():
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    BUILD.mkdir(exist_ok=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # ends its processes
    names = options.rows or list(MEASUREMENTS)
    if options.against is None:
        return show(measured(names, ROOT))
    with checked_out(options.against) as there:
        found: dict[Path, list[Row]] = {ROOT: [], there: []}
        for number in range(options.rounds):
            for tree in (ROOT, there) if number % 2 else (there, ROOT):
                found[tree] += measured(names, tree)
    return compare(found[ROOT], found[there])


def measured(names: list[str], tree: Path) -> list[Row]:
    """Return the rows; one that fails is told, and leaves the others, which took minutes, too."""
    rows: list[Row] = []
    for name in names:
        print(f"{name}, {tree.name}", file=sys.stderr, flush=True)
        try:
            rows += MEASUREMENTS[name](tree)
        except (AssertionError, OSError, ValueError, LookupError) as error:
            print(f"{name} failed: {error}", file=sys.stderr, flush=True)
    return rows


if __name__ == "__main__":
    main()
