"""Groups of commands, and commands and completions that import their modules when they are used.

Each call of the command line pays for what it imports; a module of a command may therefore import
at its top whatever the command always needs. A *home* is "module:name" of a value.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command, get_group


def loaded(home: str) -> Any:
    module, _, name = home.partition(":")
    return getattr(import_module(module), name)


def completing(home: str | Sequence[str]) -> Callable[[str], list[str]]:
    """Return a completion from words, or from a function that returns words, with this home."""

    def complete(incomplete: str) -> list[str]:
        words = loaded(home) if isinstance(home, str) else home
        return beginning_with(incomplete, words() if callable(words) else words)

    return complete


def beginning_with(typed: str, words: Any) -> list[str]:
    """Return the words that begin with what was typed."""
    return [word for word in words if word.startswith(typed)]


class Commands(TyperGroup):
    """A group whose commands take the options: one before the command gets a message."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments. Fail if an option stands before the command that it is for."""
        name = args[0].partition("=")[0] if args else ""
        known = [each for option in self.get_params(ctx) for each in option.opts]
        if name.startswith("-") and name not in known:
            where = f"{ctx.command_path} COMMAND … {name}"
            ctx.fail(f"{name} stands before the command; options go behind it: {where}")
        return list(super().parse_args(ctx, args))


def group(summary: str, *, epilog: str | None = None) -> typer.Typer:
    """Return a group of commands, which shows its plain help if none is named."""
    return typer.Typer(
        cls=Commands, no_args_is_help=True, rich_markup_mode=None, help=summary, epilog=epilog
    )


class LazyCommand(TyperCommand):
    """Stands for a command, or a group of commands, in the help and in completions."""

    def __init__(self, name: str, home: str, summary: str, *, kind: str | None = None) -> None:
        """``home`` and ``kind``, the command's class if it has its own, are in this package.

        ``summary`` is the first line of the command's own help.
        """
        super().__init__(name, help=summary)
        self._home, self._kind = f"{__package__}.{home}", kind and f"{__package__}.{kind}"

    def make_context(self, info_name: Any, args: Any, parent: Any = None, **extra: Any) -> Any:
        """Return the context of the command itself, which Typer then runs."""
        return self.load().make_context(info_name, args, parent=parent, **extra)

    def load(self) -> Any:
        value = loaded(self._home)
        if isinstance(value, typer.Typer):
            return get_group(value)
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(self.name, cls=loaded(self._kind) if self._kind else None)(value)
        return get_command(alone)
