"""``mav-tasks sim``: run the simulated rover's own command line."""

import os
import sys

import typer


def sim(context: typer.Context) -> None:
    """Run simulated rovers on UDP 14580."""
    sys.stdout.flush()
    # The simulated rover is a separate program: its process holds no code of the server.
    os.execv(sys.executable, [sys.executable, "-m", "rover_sim", *context.args])
