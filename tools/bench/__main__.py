"""Measures the server and prints one table. Nothing is asserted: take ratios, not figures.

Everything is on loopback, bounded in count and time. ``--profile FILE`` with one of ``commands``,
``forwarding`` and ``uploads`` writes cProfile's figures of the server process.
"""

import argparse
from collections.abc import Callable

from . import commands, floods, forwarding, queue, setpoints, simulation, start, stop, uploads
from .table import Row, render

MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "commands": commands.measure,
    "durable": commands.measure_durable,
    "recorded": commands.measure_recorded,
    "stop": stop.measure,
    "floods": floods.measure,
    "setpoints": setpoints.measure,
    "queue": queue.measure,
    "forwarding": forwarding.measure,
    "simulation": simulation.measure,
    "start": start.measure,
    "uploads": uploads.measure,
}
PROFILED: dict[str, Callable[[str], list[Row]]] = {
    "commands": commands.measure,
    "forwarding": forwarding.measure,
    "uploads": uploads.measure,
}


def main() -> None:
    """Measure what the command line names, or everything."""
    parser = argparse.ArgumentParser(prog="tools/bench/run", description=__doc__)
    parser.add_argument("what", nargs="*", help=", ".join(MEASUREMENTS) + "; default: all")
    parser.add_argument("--profile", metavar="FILE", help="profile the server of one measurement")
    arguments = parser.parse_args()
    unknown = set(arguments.what) - MEASUREMENTS.keys()
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    if arguments.profile is not None:
        if len(arguments.what) != 1 or arguments.what[0] not in PROFILED:
            parser.error(f"--profile goes with one of {', '.join(PROFILED)}")
        print(render(PROFILED[arguments.what[0]](arguments.profile)))
        return
    rows = [row for name in arguments.what or MEASUREMENTS for row in MEASUREMENTS[name]()]
    print(render(rows))


if __name__ == "__main__":
    main()
