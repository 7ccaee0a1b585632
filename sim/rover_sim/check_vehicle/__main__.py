"""``python -m rover_sim.check_vehicle``: figures of simulated rovers beside the real."""

from typing import Annotated

import typer

from rover_sim.check_vehicle.figures import shown
from rover_sim.check_vehicle.simulated import ROVERS, measure


def main(
    rover: Annotated[
        str, typer.Option(metavar="WORD", help=f"Rovers with this word: {', '.join(ROVERS)}.")
    ] = "",
) -> None:
    """Compare simulated rovers with recordings of real ones, in virtual time.

    The exit status is 1 if a figure differs.
    """
    names = [name for name in ROVERS if rover in name]
    if not names:
        raise typer.BadParameter(f"must be in one of {', '.join(ROVERS)}", param_hint="--rover")
    differing = 0
    for name in names:
        typer.echo(f"{name}: simulated, beside {ROVERS[name].real}")
        for row, value in measure(name, seed=0):
            is_right = row.is_right(value)
            differing += not is_right
            verdict = "ok" if is_right else "DIFFERS"
            typer.echo(
                f"{verdict}: {row.name}: {shown(value)}, real: {row.real} {row.why}".rstrip()
            )
    typer.echo(f"{differing} differ")
    raise typer.Exit(differing > 0)


if __name__ == "__main__":
    typer.run(main)
