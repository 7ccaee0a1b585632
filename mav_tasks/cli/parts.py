"""Arguments and options made from declared parts, and the values that are typed for them."""

from inspect import Parameter
from typing import Annotated, Any

import typer

from mav_tasks.basics.errors import SettingError
from mav_tasks.cli.lazy import completing
from mav_tasks.cli.times import parse_duration
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Flag

#: metavars of values by their unit
METAVARS = {
    "m": "METRES",
    "m/s": "M/S",
    "deg": "DEGREES",
    "deg/s": "DEG/S",
    "s": "DURATION",
}
SECONDS = "s"


def parameter_of(part: Part, *, key: str = "", metavar: str | None = None) -> Parameter:
    """Return the argument or option of a part, whose value is a text, or an option without one.

    ``key``: name of the parameter, if it is not that of the part.
    """
    key = key or part.name
    words = part.meaning[:1].upper() + part.meaning[1:]
    words += " (for example 30s or 5m)" if part.shape.unit == SECONDS else ""
    names = getattr(part.shape, "words", ())
    words += f": {', '.join(names)}" if names else ""
    name = f"--{part.name.replace('_', '-')}"
    if isinstance(part.shape, Flag):
        names_of_both = f"{name}/--no-{name.removeprefix('--')}"
        flag = Annotated[bool | None, typer.Option(names_of_both, help=f"{words}.")]
        default = Parameter.empty if part.is_required else None
        return Parameter(key, Parameter.KEYWORD_ONLY, default=default, annotation=flag)
    more: dict[str, Any] = {"metavar": metavar or _metavar(part), "help": f"{words}."}
    if names:
        more["autocompletion"] = completing(names)
    if part.is_required:
        kind, default = Annotated[str, typer.Argument(**more)], Parameter.empty
    else:
        option = typer.Option(name, **more)
        kind, default = Annotated[str | None, option], None
    return Parameter(key, Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _metavar(part: Part) -> str:
    return METAVARS.get(part.shape.unit, part.name.upper())


def value_of(part: Part, text: str | bool) -> object:
    """Return the plain value of a text; one that cannot be parsed is for the part to refuse."""
    if isinstance(text, bool):
        return text
    if part.shape.unit == SECONDS:
        return parse_duration(_metavar(part) if part.is_required else f"--{part.name}", text)
    try:
        return part.shape.read(text)
    except SettingError:
        return text
