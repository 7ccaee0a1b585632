"""Drive three tasks that a stock pymavlink client submits, and measure the result.

Forward 2.0 m at priority 3 starts at once; rotate 90 degrees at priority 8 and forward 1.5 m at
priority 5 wait, and the one with the higher priority runs first. Exit status 0: acknowledgements,
order, states and the measured movement are correct; 1: some are wrong; 2: it cannot be run.
"""

import argparse
from pathlib import Path

from mav_tasks.basics.errors import RecordError
from rover_sim.bullet import NO_PYBULLET, has_pybullet
from rover_sim.demo import fast, real
from rover_sim.demo.processes import DemoError
from rover_sim.demo.screen import Screen
from rover_sim.demo.third_party import problems
from rover_sim.errors import MissingExtra
from rover_sim.observing.picture import draw

OUTPUT = "demo-output"
PICTURE = "track.png"
USAGE = 2

NO_PICTURE = (
    "demo: no picture of the track: it needs matplotlib, which is not installed"
    " (pip install matplotlib)"
)
NO_WINDOW = "demo: --gui shows pybullet's window: it needs pybullet, and cannot be used with --fast"

NO_PAGE = "demo: --web needs real time, and cannot be used with --fast"
NO_FLEET = "demo: --fleet cannot be used with --fast, --web, --gui or --record"


def main() -> int:
    """Run the demonstration; return the exit status."""
    options = _parser().parse_args()
    screen = Screen()
    body = options.body or ("bullet" if has_pybullet() else "kinematic")
    if options.body is None and body == "kinematic":
        screen.say(f"demo: {NO_PYBULLET}")
    others = options.web or options.gui or options.record
    for is_wrong, words in (
        (options.gui and (options.fast or body != "bullet"), NO_WINDOW),
        (options.web and options.fast, NO_PAGE),
        (options.fleet and (options.fast or others), NO_FLEET),
    ):
        if is_wrong:
            screen.say(words)
            return USAGE
    try:
        wrong = _run(options, screen, body)
    except (DemoError, MissingExtra, RecordError) as error:
        screen.say(f"demo: {error}")
        return USAGE
    screen.say(f"demo: {wrong} wrong" if wrong else "demo: all correct")
    return int(wrong > 0)


def _run(options: argparse.Namespace, screen: Screen, body: str) -> int:
    """Show it; return how much went wrong."""
    if options.fleet:
        from rover_sim.demo import fleet  # noqa: PLC0415  # needs more packages

        return fleet.drive(screen, body=body)
    how = {"body": body, "seed": options.seed, "record": options.record}
    with screen.live():
        if options.fast:
            party, track = fast.drive(screen, **how)
        else:
            party, track = real.drive(screen, **how, gui=options.gui, web=options.web)
    screen.conclude(party)
    if track and not options.gui:
        picture = Path(options.output).resolve() / PICTURE
        try:
            draw({"Track of the rover": track.places}, picture)
        except ImportError:
            screen.say(NO_PICTURE)
        else:
            screen.say(f"picture of the track: {picture}")
    wrong = problems(party)
    for problem in wrong:
        screen.say(f"WRONG: {problem}")
    return len(wrong)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mav-tasks demo", description=__doc__.partition("\n")[0])
    add = parser.add_argument
    add("--fast", action="store_true", help="one process, virtual time, no sockets")
    add("--gui", action="store_true", help="show pybullet's window instead of writing a picture")
    add("--web", action="store_true", help="serve the web page, too, until Ctrl-C")
    add(
        "--fleet",
        action="store_true",
        help="two gateways over PostgreSQL and four rovers: one gateway is killed",
    )
    add("--body", choices=("bullet", "kinematic"), help="default: bullet if it is installed")
    add(
        "--record",
        metavar="FOLDER",
        default="",
        help="write a record for mav-tasks replay to this folder",
    )
    add(
        "--output",
        metavar="FOLDER",
        default=OUTPUT,
        help="folder for the picture; default: %(default)s",
    )
    add(
        "--seed",
        type=int,
        default=0,
        help="seed of the friction, which varies by 30 %%; 0: no variation",
    )
    return parser
