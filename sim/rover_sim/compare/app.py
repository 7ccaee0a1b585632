"""Compare simulated rovers with recordings of real ones, in the same manoeuvres.

Virtual time, no server, no sockets. Exit status 0: each figure is within a factor of 1.5 of the
real one or explained; 1: some differ; 2: usage.
"""

import argparse
import sys
from collections.abc import Sequence

from rover_sim.compare.measuring import RUNS, measure
from rover_sim.compare.pairs import PAIRS, Pair
from rover_sim.compare.report import lines
from rover_sim.compare.verdict import Verdict, compare, missing


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison; return the exit status."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    pairs = [
        pair
        for pair in PAIRS
        if options.autopilot in (None, pair.autopilot) and options.frame in (None, pair.frame.value)
    ]
    if options.runs < 1:
        parser.error("--runs must be at least 1")
    if not pairs:
        parser.error(f"there is no {options.frame} rover with {options.autopilot}")
    differing = 0
    for pair in pairs:
        differing += _show(pair, options)
    return 1 if differing else 0


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="compare_rovers", description=(__doc__ or "").partition("\n")[0]
    )
    add = parser.add_argument
    add("--autopilot", choices=sorted({pair.autopilot for pair in PAIRS}), help="default: both")
    add("--frame", choices=sorted({pair.frame.value for pair in PAIRS}), help="default: all")
    add(
        "--only", metavar="WORD", default="", help="only groups of figures whose name contains WORD"
    )
    add("--brief", action="store_true", help="only figures that differ without an explanation")
    add("--seed", type=int, default=0, help="seed of the first run (default %(default)s)")
    add(
        "--runs",
        type=int,
        default=RUNS,
        help="number of runs, each with its own seed (default %(default)s)",
    )
    return parser


def _show(pair: Pair, options: argparse.Namespace) -> int:
    """Print one rover's table; return how many figures differ."""
    figures = measure(pair, seed=options.seed, runs=options.runs)
    comparisons = [
        each for each in compare(pair, figures) if options.only.lower() in each.figure.group.lower()
    ]
    hidden = frozenset({Verdict.OK, Verdict.EXPLAINED} if options.brief else ())
    for line in lines(pair, comparisons, hidden=hidden):
        sys.stdout.write(f"{line}\n")
    absent = missing(pair, figures)
    for group, name in absent:
        sys.stdout.write(f"{pair.name}: not measured: {group}: {name}\n")
    sys.stdout.write("\n")
    return sum(each.verdict is Verdict.DIFFERS for each in comparisons) + len(absent)
