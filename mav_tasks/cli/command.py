"""Typer commands from async functions, with shared groups of options.

A group is a frozen dataclass with Typer annotations and defaults, or a class that says which
``parameters`` it has. A parameter of that type stands for all fields of the group as options.
"""

import asyncio
import dataclasses
import inspect
from collections.abc import Callable, Coroutine
from difflib import get_close_matches
from itertools import takewhile
from typing import Any

from typer.core import TyperCommand

#: context settings of a NumbersCommand
NUMBERS = {"ignore_unknown_options": True}


class NumbersCommand(TyperCommand):
    """A command that accepts negative numbers as arguments, but no mistyped options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments. Fail if one is an unknown option."""
        known = [name for each in self.get_params(ctx) for name in each.opts + each.secondary_opts]
        for argument in takewhile(lambda each: each != "--", args):
            name = argument.partition("=")[0]
            if name.startswith("-") and name not in known and not _is_number(name):
                ctx.fail(f"No such option: {name}{_similar(name, known)}")
        return super().parse_args(ctx, args)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _similar(name: str, known: list[str]) -> str:
    close = get_close_matches(name, known)
    return f" (Possible options: {', '.join(sorted(close))})" if close else ""


def command(body: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Return a Typer command that runs ``body`` on its own event loop."""
    groups: dict[str, Any] = {
        name: parameter.annotation
        for name, parameter in inspect.signature(body).parameters.items()
        if _options_of(parameter.annotation)
    }

    def run(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(
                **{each.name: values.pop(each.name) for each in _options_of(group)}
            )
        asyncio.run(body(**values))

    parameters = _spread(body)
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    run.__doc__ = body.__doc__
    run.__name__ = body.__name__
    return run


def _spread(body: Callable[..., Any]) -> list[inspect.Parameter]:
    spread: list[inspect.Parameter] = []
    for parameter in inspect.signature(body).parameters.values():
        alone = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        spread += _options_of(parameter.annotation) or [alone]
    return spread


def _options_of(group: Any) -> list[inspect.Parameter]:
    """Return the options of a group; an empty list for any other type."""
    if hasattr(group, "parameters"):
        return list(group.parameters())
    if not dataclasses.is_dataclass(group):
        return []
    return [
        inspect.Parameter(
            each.name, inspect.Parameter.KEYWORD_ONLY, default=each.default, annotation=each.type
        )
        for each in dataclasses.fields(group)
    ]
