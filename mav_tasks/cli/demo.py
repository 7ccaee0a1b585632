"""``mav-tasks demo``: run the demonstration, a program of the simulated rover."""

import os
import sys

import typer


def demo(context: typer.Context) -> None:
    """Run the demonstration: three tasks, driven and measured."""
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-m", "rover_sim.demo", *context.args])
