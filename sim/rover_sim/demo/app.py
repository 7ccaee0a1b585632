"""Drive three tasks that a stock pymavlink client submits, and measure the result.

Forward 2.0 m at priority 3 starts at once; rotate 90 degrees at priority 8 and forward 1.5 m at
priority 5 wait, and the one with the higher priority runs first. Exit status 0: acknowledgements,
order, states and the measured movement are correct; 1: some are wrong; 2: it cannot be run.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Option

from mav_tasks.basics.errors import MavTasksError
from rover_sim.bullet import NO_PYBULLET, has_pybullet
from rover_sim.demo import fast as virtual
from rover_sim.demo import real
from rover_sim.errors import MissingExtra
from rover_sim.observing.picture import draw
from rover_sim.testing.processes import ProcessFailed

PICTURE = "track.png"
USAGE = 2

NO_PICTURE = (
    "no picture of the track: it needs matplotlib, which is not installed (pip install matplotlib)"
)
NO_WINDOW = "--gui shows pybullet's window: it needs pybullet, and cannot be used with --fast"
NO_PAGE = "--web needs real time, and cannot be used with --fast"
NO_FLEET = "--fleet cannot be used with --fast, --web, --gui or --record"


def demo(
    fast: Annotated[bool, Option("--fast", help="One process, virtual time, no sockets.")] = False,
    gui: Annotated[
        bool, Option("--gui", help="Show pybullet's window instead of writing a picture.")
    ] = False,
    web: Annotated[bool, Option("--web", help="Serve the web page, too, until Ctrl-C.")] = False,
    fleet: Annotated[
        bool,
        Option("--fleet", help="Two gateways over PostgreSQL, four rovers: one gateway is killed."),
    ] = False,
    body: Annotated[
        Literal["bullet", "kinematic"] | None, Option(help="Default: bullet if it is installed.")
    ] = None,
    record: Annotated[
        str, Option(metavar="FOLDER", help="Write a record for mav-tasks replay to this folder.")
    ] = "",
    output: Annotated[Path, Option(metavar="FOLDER", help="Folder for the picture.")] = Path(
        "demo-output"
    ),
    seed: Annotated[
        int, Option(help="Seed of the friction, which varies by 30 %; 0: no variation.")
    ] = 0,
) -> None:
    """Run the demonstration: three tasks, driven and measured."""
    kind = body or ("bullet" if has_pybullet() else "kinematic")
    if body is None and kind == "kinematic":
        _say(NO_PYBULLET)
    for is_wrong, words in (
        (gui and (fast or kind != "bullet"), NO_WINDOW),
        (web and fast, NO_PAGE),
        (fleet and (fast or web or gui or record), NO_FLEET),
    ):
        if is_wrong:
            _say(words)
            raise typer.Exit(USAGE)
    try:
        if fleet:
            from rover_sim.demo import fleet as gateways  # noqa: PLC0415  # needs more packages

            wrong = gateways.drive(body=kind)
        else:
            if fast:
                party, track = virtual.drive(body=kind, seed=seed, record=record)
            else:
                party, track = real.drive(body=kind, seed=seed, record=record, gui=gui, web=web)
            wrong = party.conclude()
            picture = output.resolve() / PICTURE
            if not gui and find_spec("matplotlib") is None:
                _say(NO_PICTURE)
            elif not gui:
                draw({"Track of the rover": track.places}, picture)
                typer.echo(f"picture of the track: {picture}")
    except (ProcessFailed, MissingExtra, MavTasksError, OSError) as error:
        _say(str(error))
        raise typer.Exit(USAGE) from error
    _say(f"{wrong} wrong" if wrong else "all correct")
    raise typer.Exit(wrong > 0)


def _say(text: str) -> None:
    typer.echo(f"demo: {text}")
