"""The ``mav-tasks`` command: runs one of ``commands``, and reports errors."""

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper

import typer

from mav_tasks.cli import exit_codes
from mav_tasks.cli.root import Root, root

app = typer.Typer(
    cls=Root,
    callback=root,
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help: rich would take a third of the time to show it
    pretty_exceptions_enable=False,
    epilog=exit_codes.TABLE,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
