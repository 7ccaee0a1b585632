"""``mav-tasks demo``: hand over to the demonstration, which is the simulated rover's."""

import os
import sys

import typer


def demo(context: typer.Context) -> None:
    """Show it: three tasks are driven, and measured."""
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-m", "rover_sim.demo", *context.args])
