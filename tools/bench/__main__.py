"""Measures the server and prints one table. Nothing is asserted: take ratios, not figures.

Everything runs on loopback, bounded in count and time. ``--profile FILE`` with one of ``commands``,
``forwarding`` and ``uploads`` writes cProfile's figures of the server process. ``--against
REVISION`` also measures a server of that revision, alternating with this one, with the same
clients. ``--names N`` with ``turns`` prints the functions that are called most.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict

from . import (
    against,
    calls,
    carrier,
    commands,
    floods,
    forwarding,
    gateways,
    load,
    postgres,
    queue,
    scrapers,
    setpoints,
    simulation,
    start,
    stop,
    strangers,
    telemetry,
    turns,
    uploads,
    web,
)
from .table import Row, render

MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "commands": commands.measure,
    "durable": commands.measure_durable,
    "postgres": postgres.measure,
    "carrier": carrier.measure,
    "gateways": gateways.measure,
    "recorded": commands.measure_recorded,
    "turns": turns.measure,
    "stop": stop.measure,
    "floods": floods.measure,
    "load": load.measure,
    "strangers": strangers.measure,
    "setpoints": setpoints.measure,
    "scrapers": scrapers.measure,
    "queue": queue.measure,
    "forwarding": forwarding.measure,
    "telemetry": telemetry.measure,
    "simulation": simulation.measure,
    "start": start.measure,
    "calls": calls.measure,
    "uploads": uploads.measure,
    "web": web.measure,
}
PROFILED: dict[str, Callable[[str], list[Row]]] = {
    "commands": commands.measure,
    "forwarding": forwarding.measure,
    "uploads": uploads.measure,
}
#: measurements of a server process, which may run another revision
OF_A_SERVER = (
    "commands",
    "durable",
    "recorded",
    "stop",
    "floods",
    "load",
    "setpoints",
    "forwarding",
    "telemetry",
    "uploads",
)


def main() -> None:
    """Run the measurements on the command line, or all of them."""
    parser = argparse.ArgumentParser(prog="tools/bench/run", description=__doc__)
    parser.add_argument("what", nargs="*", help=", ".join(MEASUREMENTS) + "; default: all")
    parser.add_argument("--profile", metavar="FILE", help="profile the server of one measurement")
    parser.add_argument("--against", metavar="REVISION", help="measure that revision's server, too")
    parser.add_argument(
        "--rounds",
        type=int,
        default=3,
        metavar="N",
        help="with --against: rounds (default 3)",
    )
    parser.add_argument(
        "--names",
        type=int,
        default=0,
        metavar="N",
        help="with turns: print the N most called functions",
    )
    parser.add_argument("--json", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    unknown = set(arguments.what) - MEASUREMENTS.keys()
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    if arguments.profile is not None:
        if len(arguments.what) != 1 or arguments.what[0] not in PROFILED:
            parser.error(f"--profile goes with one of {', '.join(PROFILED)}")
        print(render(PROFILED[arguments.what[0]](arguments.profile)))
        return
    if arguments.against is not None:
        _measure_against(parser, arguments)
        return
    rows = [row for name in arguments.what or MEASUREMENTS for row in _measured(name, arguments)]
    print(json.dumps([asdict(row) for row in rows]) if arguments.json else render(rows))


def _measured(name: str, arguments: argparse.Namespace) -> list[Row]:
    if name == "turns":
        return turns.measure(names=arguments.names)
    return MEASUREMENTS[name]()


def _measure_against(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    what = arguments.what or [*OF_A_SERVER, "turns"]
    alone = [name for name in what if name not in (*OF_A_SERVER, "turns")]
    if alone:
        parser.error(f"--against does not go with {', '.join(alone)}")
    if arguments.rounds < 1:
        parser.error("--rounds: expected a number from 1 on")
    if "turns" in what:
        print(render(turns.measure(arguments.against, names=arguments.names)))
    servers = [name for name in what if name != "turns"]
    if servers:
        pairs = against.measure(arguments.against, servers, rounds=arguments.rounds)
        print(against.render(pairs))


if __name__ == "__main__":
    main()
