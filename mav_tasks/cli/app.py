"""The ``mav-tasks`` command: runs one of ``commands``, and reports errors with an exit status."""

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from typing import Annotated, Any

import typer

from mav_tasks.cli import exit_codes
from mav_tasks.cli.commands import COMMANDS
from mav_tasks.cli.lazy import Commands


class Root(Commands):
    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for each in COMMANDS:
            self.add_command(each)

    def invoke(self, ctx: Any) -> Any:
        """Run a command. Raise Exit with our status after Ctrl-C or a closed pipe."""
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()  # here, where a closed pipe is handled
        except (KeyboardInterrupt, BrokenPipeError) as error:  # Typer would handle them otherwise
            raise typer.Exit(exit_codes.tell(error)) from None
        return result


def _show_version(is_asked: bool) -> None:
    if is_asked:
        from importlib.metadata import version  # noqa: PLC0415

        sys.stdout.write(f"mav-tasks {version('mav-tasks')}\n")
        raise typer.Exit


def root(
    version: Annotated[  # its callback uses it
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """A MAVLink task server: it queues commands as tasks and drives rovers."""


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
    if "mav_tasks.shell.serve" in sys.modules or not isinstance(status, int | None):
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (AttributeError, OSError, ValueError):  # closed, or a full disk: Python reports that
        return
    os._exit(status or 0)
