"""The ``mav-tasks`` command: composes all commands."""

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper

import typer

from mav_tasks.cli import config, control, exit_codes, halts, keys, plans, submit
from mav_tasks.cli.completions import DemoCommand, SimCommand
from mav_tasks.cli.demo import demo
from mav_tasks.cli.dialect import dialect
from mav_tasks.cli.history import history
from mav_tasks.cli.log import log
from mav_tasks.cli.probe import probe
from mav_tasks.cli.qgc_actions import qgc_actions
from mav_tasks.cli.queue import queue
from mav_tasks.cli.ready import ready
from mav_tasks.cli.replay import replay
from mav_tasks.cli.root import Root, root
from mav_tasks.cli.serve import ServeCommand, serve
from mav_tasks.cli.sim import sim
from mav_tasks.cli.status import status
from mav_tasks.cli.vehicles import vehicles

app = typer.Typer(
    cls=Root,
    callback=root,
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help: rich would take a third of the time to show it
    pretty_exceptions_enable=False,
    epilog=exit_codes.TABLE,
    context_settings={"help_option_names": ["-h", "--help"]},
)

PASSED_ON = {"allow_extra_args": True, "ignore_unknown_options": True}

app.command(cls=ServeCommand)(serve)
app.command(cls=SimCommand, context_settings=PASSED_ON, add_help_option=False)(sim)
app.command(cls=DemoCommand, context_settings=PASSED_ON, add_help_option=False)(demo)
app.add_typer(submit.app, name="submit")
app.command()(status)
app.command()(queue)
app.command()(history)
app.command()(control.cancel)
app.command()(control.clear)
app.command()(halts.stop)
app.command()(halts.pause)
app.command()(halts.resume)
app.command()(control.modify)
app.command()(control.release)
app.command()(vehicles)
app.command()(ready)
app.command()(probe)
app.add_typer(plans.mission, name="mission")
app.add_typer(plans.fence, name="fence")
app.add_typer(plans.rally, name="rally")
app.command()(log)
app.command()(replay)
app.add_typer(config.app, name="config")
app.add_typer(keys.app, name="keys")
app.command("qgc-actions")(qgc_actions)
app.command()(dialect)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line. Report an error as one line on standard error and an exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # for terminals with ASCII only
    try:
        app(arguments, prog_name="mav-tasks")
    except exit_codes.TOLD as error:
        sys.exit(exit_codes.tell(error))
    except SystemExit as end:
        if arguments is None:  # a process of its own
            _leave(end.code)
        raise


def _leave(status: object) -> None:
    """End the process without taking its objects apart, which is a fifth of a short call's time.

    Return where an ordinary end is needed: for the server, or if the output cannot be written.
    """
    if "mav_tasks.serve" in sys.modules or not isinstance(status, int | None):
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (AttributeError, OSError, ValueError):  # closed, or a full disk: Python reports that
        return
    os._exit(status or 0)
