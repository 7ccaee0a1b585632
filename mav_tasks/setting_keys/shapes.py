"""The kinds of values of settings, with validation and conversion. Pure.

A *plain* value is as people and TOML write it (degrees, days, lists); a *kept* value is as the
settings have it (radians, seconds, tuples). A SettingError does not name the setting: the caller
knows it.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from mav_tasks.errors import SettingError
from mav_tasks.setting_keys.literals import in_digits, literal

#: MAVLink address with an optional endpoint, as in ``str(Submitter)``
CLIENT = re.compile(r"(\d{1,3})/(\d{1,3})(@[^\s@=,]+)?")
HIGHEST_PRIORITY = 10
HIGHEST_ID = 255


class Shape(Protocol):
    """A kind of values."""

    @property
    def unit(self) -> str:
        """The unit of a plain value, "" for none."""

    @property
    def valid(self) -> str:
        """The valid plain values, as text."""

    def kept(self, plain: object) -> Any:
        """Return the kept value of a plain value; raise SettingError if it is invalid."""

    def plain(self, kept: Any) -> object:
        """Return the plain value of a kept value."""

    def read(self, text: str) -> object:
        """Return the plain value of a text; raise SettingError if it cannot be parsed."""


class _AsWritten:
    """What is kept as people write it."""

    __slots__ = ()

    def plain(self, kept: object) -> object:
        return kept

    def read(self, text: str) -> object:
        """Return the text; ``kept`` refuses a wrong one."""
        return text


@dataclass(frozen=True, slots=True)
class Number:
    """A number from ``low`` to ``high``; the kept value is multiplied by ``scale``.

    ``none`` is a word for "no limit", kept as None.
    """

    low: float
    high: float
    unit: str = ""
    scale: float = 1.0
    is_whole: bool = False
    none: str = ""

    @property
    def valid(self) -> str:
        words = f"{in_digits(self.low)}..{in_digits(self.high)}"
        words += f" {self.unit}" if self.unit else ""
        words += ", whole" if self.is_whole else ""
        return words + (f', or "{self.none}"' if self.none else "")

    def kept(self, plain: object) -> float | None:
        """Return the number in the unit of the settings."""
        if self.none and plain == self.none:
            return None
        if isinstance(plain, bool) or not isinstance(plain, int | float):
            raise SettingError(f"not a number: {self.valid}")
        if not self.low <= plain <= self.high:  # also refuses NaN
            raise SettingError(f"not in {self.valid}")
        if not self.is_whole:
            return float(plain) * self.scale
        if plain != int(plain):
            raise SettingError(f"not a whole number: {self.valid}")
        return int(plain)

    def plain(self, kept: float | None) -> object:
        """Return the number as it was written: 40 degrees, not 39.99999999."""
        if kept is None:
            return self.none
        return kept if self.is_whole else float(f"{kept / self.scale:.12g}")

    def read(self, text: str) -> object:
        """Parse a number, or the word for "no limit"."""
        if self.none and text == self.none:
            return text
        try:
            return int(text)
        except ValueError:
            pass
        try:
            return float(text)
        except ValueError:
            raise SettingError(f"not a number: {self.valid}") from None


@dataclass(frozen=True, slots=True)
class Choice(_AsWritten):
    """One of several words."""

    words: tuple[str, ...]
    unit: str = ""

    @property
    def valid(self) -> str:
        return " | ".join(f'"{word}"' for word in self.words)

    def kept(self, plain: object) -> str:
        """Return the word; raise SettingError for another one."""
        if plain not in self.words:
            raise SettingError(f"expected one of {', '.join(self.words)}")
        return str(plain)


@dataclass(frozen=True, slots=True)
class Flag(_AsWritten):
    unit: str = ""
    valid: str = "true | false"

    def kept(self, plain: object) -> bool:
        """Return the boolean; raise SettingError for another type."""
        if not isinstance(plain, bool):
            raise SettingError("expected true or false")
        return plain

    def read(self, text: str) -> object:
        """Parse "true" or "false", in any case; return other texts for ``kept`` to refuse."""
        return {"true": True, "false": False}.get(text.lower(), text)


@dataclass(frozen=True, slots=True)
class Text(_AsWritten):
    """A text; ``valid`` describes it. An empty text is valid."""

    valid: str
    unit: str = ""

    def kept(self, plain: object) -> str:
        if not isinstance(plain, str) or "\0" in plain:
            raise SettingError(f"not a text: {self.valid}")
        return plain


@dataclass(frozen=True, slots=True)
class Texts:
    """A list of texts; ``read`` takes them separated by commas."""

    valid: str
    least: int = 0  # minimum number of texts
    words: tuple[str, ...] = ()  # the allowed texts; (): any
    unit: str = ""

    def kept(self, plain: object) -> tuple[str, ...]:
        if not isinstance(plain, list) or not all(isinstance(each, str) for each in plain):
            raise SettingError(f"not a list of texts: {self.valid}")
        if len(plain) < self.least:
            raise SettingError(f"fewer than {self.least}: {self.valid}")
        unknown = [each for each in plain if self.words and each not in self.words]
        if unknown:
            raise SettingError(f"{unknown[0]!a}: expected {self.valid}")
        return tuple(plain)

    def plain(self, kept: tuple[str, ...]) -> object:
        return list(kept)

    def read(self, text: str) -> object:
        """Split a text at commas; an empty text is an empty list."""
        return [each.strip() for each in text.split(",")] if text.strip() else []


@dataclass(frozen=True, slots=True)
class ByClient:
    """A value for each named client; ``read`` takes ``255/190=7,245/190=3``."""

    each: Shape
    example: Any
    unit: str = ""

    @property
    def valid(self) -> str:
        """An example, and the valid values of each client."""
        value = literal(self.example)
        clients = f'{{ "255/190" = {value}, "255/190@127.0.0.1:14550" = {value} }}'
        return f"{clients}, each {self.each.valid}"

    def kept(self, plain: object) -> Mapping[str, Any]:
        if not isinstance(plain, dict):
            raise SettingError(f"not a table: {self.valid}")
        kept = {}
        for client, value in plain.items():
            found = CLIENT.fullmatch(client)
            if found is None or not all(0 < int(each) <= HIGHEST_ID for each in found.groups()[:2]):
                raise SettingError(f"{client!a}: no client, expected {self.valid}")
            try:
                kept[client] = self.each.kept(value)
            except SettingError as error:
                raise SettingError(f"{client}: {error}") from None
        return kept

    def plain(self, kept: Mapping[str, Any]) -> object:
        return {client: self.each.plain(value) for client, value in kept.items()}

    def read(self, text: str) -> object:
        """Split a text at commas, and each part at its last equals sign."""
        values: dict[str, object] = {}
        for each in text.split(",") if text.strip() else ():
            client, _, value = each.strip().rpartition("=")
            values[client] = self.each.read(value)
        return values
