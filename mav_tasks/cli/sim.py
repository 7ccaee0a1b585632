"""``mav-tasks sim``: hand over to the simulated rover's own command line."""

import os
import sys

import typer


def sim(context: typer.Context) -> None:
    """Run simulated rovers on UDP 14580."""
    sys.stdout.flush()
    # The simulated rover is a program of its own: nothing of the server is in its process.
    os.execv(sys.executable, [sys.executable, "-m", "rover_sim", *context.args])
