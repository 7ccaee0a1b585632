"""Drive three tasks that a stock pymavlink client submits, and measure the result.

Forward 2.0 m at priority 3 starts at once; rotate 90 degrees at priority 8 and forward 1.5 m at
priority 5 wait, and the one with the higher priority runs first. Exit status 0: acknowledgements,
order, states and the measured movement are correct; 1: some are wrong; 2: it cannot be run.
"""

import argparse
from pathlib import Path

from rich.console import Console

from mav_tasks.basics.errors import RecordError
from rover_sim.bullet import NO_PYBULLET, has_pybullet
from rover_sim.demo import fast, real
from rover_sim.demo.processes import DemoError
from rover_sim.demo.report import draw, print_table, problems
from rover_sim.demo.screen import Screen
from rover_sim.demo.third_party import Place, ThirdParty
from rover_sim.errors import MissingExtra

OUTPUT = "demo-output"
PICTURE = "track.png"

PIPE_WIDTH = 110  # columns, if the output is no terminal

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
    console = Console()
    if not console.is_terminal:
        console = Console(width=PIPE_WIDTH)
    body = options.body or ("bullet" if has_pybullet() else "kinematic")
    if options.body is None and body == "kinematic":
        _say(console, f"demo: {NO_PYBULLET}")
    if options.gui and (options.fast or body != "bullet"):
        _say(console, NO_WINDOW)
        return 2
    if options.web and options.fast:
        _say(console, NO_PAGE)
        return 2
    if options.fleet and (options.fast or options.web or options.gui or options.record):
        _say(console, NO_FLEET)
        return 2
    try:
        with Screen(console) as screen:
            if options.fleet:
                from rover_sim.demo import fleet  # noqa: PLC0415  # needs more packages

                return _judge(console, fleet.drive(screen, body=body))
            party, track = _drive(screen, options, body)
    except (DemoError, MissingExtra, RecordError) as error:
        _say(console, f"demo: {error}")
        return 2
    picture = None if options.gui else Path(options.output).resolve() / PICTURE
    return _conclude(console, party, track, picture)


def _drive(
    screen: Screen, options: argparse.Namespace, body: str
) -> tuple[ThirdParty, list[Place]]:
    if options.fast:
        return fast.drive(
            screen,
            body=body,
            seed=options.seed,
            record=options.record,
        )
    return real.drive(
        screen,
        body=body,
        gui=options.gui,
        seed=options.seed,
        record=options.record,
        web=options.web,
    )


def _conclude(console: Console, party: ThirdParty, track: list[Place], picture: Path | None) -> int:
    print_table(console, party)
    if picture is not None and track:
        try:
            draw(track, picture)
        except ImportError:
            _say(console, NO_PICTURE)
        else:
            _say(console, f"picture of the track: {picture}")
    wrong = problems(party)
    for problem in wrong:
        _say(console, f"WRONG: {problem}")
    return _judge(console, len(wrong))


def _judge(console: Console, wrong: int) -> int:
    _say(console, f"demo: {wrong} wrong" if wrong else "demo: all correct")
    return 1 if wrong else 0


def _say(console: Console, text: str) -> None:
    console.print(text, soft_wrap=True, markup=False, highlight=False)


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
