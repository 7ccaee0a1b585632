"""The root command group: ``--version``, and the exit status of an interrupted command."""

import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from mav_tasks.cli import exit_codes
from mav_tasks.cli.commands import COMMANDS


class Root(TyperGroup):
    """The group of all commands."""

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
