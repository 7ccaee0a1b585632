"""An async function becomes a command; options that many commands have are written once, as groups.

A group is a frozen dataclass whose fields are annotated as Typer has it. A parameter of that type
stands for all of its options.
"""

import dataclasses
import inspect
import sys
from collections.abc import Callable, Coroutine
from io import TextIOWrapper
from typing import Any

#: negative numbers are arguments and no options
NUMBERS = {"ignore_unknown_options": True}


def command(body: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Give what Typer takes for a command; it runs ``body`` on a loop of its own."""
    groups: dict[str, Any] = {
        name: parameter.annotation
        for name, parameter in inspect.signature(body).parameters.items()
        if dataclasses.is_dataclass(parameter.annotation)
    }

    def run(**values: Any) -> None:
        import asyncio  # noqa: PLC0415

        if isinstance(sys.stdout, TextIOWrapper):
            sys.stdout.reconfigure(errors="replace")  # a terminal that knows ASCII only
        for name, group in groups.items():
            fields = [field.name for field in dataclasses.fields(group)]
            values[name] = group(**{field: values.pop(field) for field in fields})
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
        if dataclasses.is_dataclass(parameter.annotation):
            spread += [_parameter(field) for field in dataclasses.fields(parameter.annotation)]
        else:
            spread.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    return spread


def _parameter(field: "dataclasses.Field[Any]") -> inspect.Parameter:
    is_needed = field.default is dataclasses.MISSING
    return inspect.Parameter(
        field.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if is_needed else field.default,
        annotation=field.type,
    )
