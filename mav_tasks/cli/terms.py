"""The options for the terms of a task, made from their declarations; times as people write them."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from inspect import Parameter
from typing import Any, ClassVar

from mav_tasks.basics.errors import UsageError
from mav_tasks.cli.parts import parameter_of, value_of
from mav_tasks.cli.times import parse_duration, parse_moment
from mav_tasks.client.terms import OF_CHANGES, OF_NEW
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Text
from mav_tasks.tasks.task import MAX_PRIORITY

NEVER = "never"  # of --every
PARTS = OF_CHANGES | {
    "delay": replace(OF_CHANGES["delay"], name="in"),
    "at": replace(
        OF_CHANGES["at"],
        meaning="start at 14:30 or 2026-11-20T14:30; local time unless it names a zone",
    ),
    "every": replace(
        OF_CHANGES["every"],
        shape=Text("a period"),
        meaning="repeat: 90s, 1h30m, 1d, or a cron expression in UTC or a zone:"
        f" '0 6 * * 1-5 Europe/Zurich'; {NEVER}: do not repeat any more",
    ),
}
#: metavars of the options that do not show what their values look like
METAVARS = {
    "priority": f"0..{MAX_PRIORITY}",
    "after": "ID",
    "before": "ID",
    "label": "TEXT",
    "at": "TIME",
    "every": f"PERIOD|CRON|{NEVER}",
}


class _Typed:
    """The options of some terms, as they were typed; an empty text says nothing, but no label."""

    of: ClassVar[Mapping[str, Part]]

    def __init__(self, **typed: str | bool | None) -> None:
        given = {name: text for name, text in typed.items() if text is not None}
        self._typed = {name: text for name, text in given.items() if text != "" or name == "label"}

    @classmethod
    def parameters(cls) -> list[Parameter]:
        """Return the options, for ``command``."""
        return [parameter_of(PARTS[name], key=name, metavar=METAVARS.get(name)) for name in cls.of]

    def read(self) -> Any:
        """Return the terms that are given, as the library takes them.

        Raise UsageError or SettingError if one is invalid.
        """
        if {"delay", "at"} <= self._typed.keys():
            raise UsageError("--in and --at: choose one of them")
        return {name: _read(name, text) for name, text in self._typed.items()}


class NewTerms(_Typed):
    """The options for when and how a new task runs."""

    of = OF_NEW


class ChangedTerms(_Typed):
    """The options for what is to be changed of that."""

    of = OF_CHANGES


def _read(name: str, text: str | bool) -> Any:
    part = PARTS[name]
    if name == "at":
        return parse_moment("--at", str(text), now=datetime.now(UTC))
    if name == "every":
        return _every_of(str(text))
    return part.read({part.name: value_of(part, text)}, within="--")


def _every_of(text: str) -> float | str:
    """Return the term of a period or expression; the library checks the rest."""
    if text == NEVER:
        return 0.0
    return text if len(text.split()) > 1 else parse_duration("--every", text)
