"""The demonstration: a rover drives the tutorial's three tasks, submitted by a third party.

Forward 2.0 m at priority 3 starts at once; rotate 90 degrees at 8 and forward 1.5 m at 5 wait, and
the more urgent of them runs first. Exit code 0 only if acknowledgements, order, states and the
measured movement are all as they should be; 1 if not; 2 if it cannot be run.
"""

import argparse
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from demo_lib import fast, real
from demo_lib.report import draw, print_table, problems
from demo_lib.screen import Screen
from demo_lib.third_party import Place, ThirdParty
from rover_sim.errors import MissingExtra

PICTURE = Path(__file__).resolve().parents[2] / "demo-output" / "track.png"

PIPE_WIDTH = 110  # columns, where there is no terminal to fit

NO_PYBULLET = (
    "demo: pybullet is not installed, so the rover is the kinematic one: no wheels, no friction.\n"
    "      There are wheels for Python 3.10 and 3.11 on Linux x86-64: with python3.11 (or uv)\n"
    "      installed, remove .venv and run tools/demo again."
)


def main() -> int:
    """Run the demonstration; gives the exit code."""
    options = _parser().parse_args()
    body = options.body or ("bullet" if find_spec("pybullet") else "kinematic")
    if options.body is None and body == "kinematic":
        print(NO_PYBULLET)
    if options.gui and (options.fast or body != "bullet"):
        print("demo: --gui is pybullet's window: it needs pybullet, and goes without --fast")
        return 2
    console = Console()
    if not console.is_terminal:
        console = Console(width=PIPE_WIDTH)
    try:
        with Screen(console) as screen:
            party, track = _drive(screen, options, body)
    except (real.DemoError, MissingExtra) as error:
        print(f"demo: {error}")
        return 2
    return _conclude(console, party, track, picture=not options.gui)


def _drive(
    screen: Screen, options: argparse.Namespace, body: str
) -> tuple[ThirdParty, list[Place]]:
    if options.fast:
        return fast.drive(screen, body=body, seed=options.seed)
    return real.drive(screen, body=body, gui=options.gui, seed=options.seed)


def _conclude(console: Console, party: ThirdParty, track: list[Place], *, picture: bool) -> int:
    print_table(console, party)
    if picture and track:
        draw(track, PICTURE)
        console.print(f"picture of the track: {PICTURE}", soft_wrap=True, highlight=False)
    wrong = problems(party)
    for problem in wrong:
        console.print(f"WRONG: {problem}", markup=False, highlight=False)
    console.print("demo: all as it should be" if not wrong else f"demo: {len(wrong)} wrong")
    return 1 if wrong else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="tools/demo", description=__doc__.partition("\n")[0])
    add = parser.add_argument
    add("--fast", action="store_true", help="one process, virtual time, no sockets")
    add("--gui", action="store_true", help="open pybullet's window; no picture then")
    add("--body", choices=("bullet", "kinematic"), help="default: bullet where it is installed")
    add("--seed", type=int, default=0, help="varies friction by 30 %% either way; 0: not")
    return parser
