"""The kinds of values of settings and requests, with validation and conversion. Pure.

A *plain* value is as people, TOML and JSON write it (degrees, days, lists); a *kept* value is as
the code has it (radians, seconds, tuples). A SettingError does not name the value's place: the
caller knows it.
"""

import re
from collections.abc import Mapping, Sized
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.literals import in_digits, literal

#: MAVLink address with an optional endpoint, as in ``str(Submitter)``
CLIENT = re.compile(r"(\d{1,3})/(\d{1,3})(@[^\s@=,]+)?")
HIGHEST_PRIORITY = 10
HIGHEST_ID = 255
LARGEST = 3.4e38  # a bound that is this far, as far as a float32 goes, is not told


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
        unit = f" {self.unit}" if self.unit else ""
        words = f"{in_digits(self.low)}..{in_digits(self.high)}{unit}"
        if self.low <= -LARGEST:
            words = f"any number ({self.unit})" if unit else "any number"
        elif self.high >= LARGEST:
            words = f"{in_digits(self.low)}{unit} or more"
        words += ", whole" if self.is_whole else ""
        return words + (f', or "{self.none}"' if self.none else "")

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of a plain value."""
        bounds = {"minimum": self.low, "maximum": self.high}
        told = {name: bound for name, bound in bounds.items() if abs(bound) < LARGEST}
        return {"type": "integer" if self.is_whole else "number", **told}

    def kept(self, plain: object) -> float | None:
        """Return the number in the unit of the settings."""
        if self.none and plain == self.none:
            return None
        if isinstance(plain, bool) or not isinstance(plain, int | float):
            raise SettingError(f"not a number: {self.valid}")
        if not self.low <= plain <= self.high:  # also refuses NaN
            words = "not in" if self.high < LARGEST else "expected"
            raise SettingError(f"{words} {self.valid}")
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

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of a word."""
        return {"type": "string", "enum": list(self.words)}

    def kept(self, plain: object) -> str:
        """Return the word; raise SettingError for another one."""
        if plain not in self.words:
            raise SettingError(f"expected one of {', '.join(self.words)}")
        return str(plain)


@dataclass(frozen=True, slots=True)
class Name(_AsWritten):
    """One of several words, or a whole number from 0 to ``most``."""

    words: tuple[str, ...]
    most: int
    unit: str = ""

    @property
    def valid(self) -> str:
        return f"{', '.join(self.words)}, or a number from 0 to {self.most}"

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of a word or number."""
        number = {"type": "integer", "minimum": 0, "maximum": self.most}
        return {"anyOf": [{"type": "string", "enum": list(self.words)}, number]}

    def kept(self, plain: object) -> str | int:
        """Return the word or number; raise SettingError for another value."""
        if isinstance(plain, str) and plain in self.words:
            return plain
        if type(plain) is int and 0 <= plain <= self.most:
            return plain
        raise SettingError(f"expected {self.valid}")

    def read(self, text: str) -> object:
        """Parse a number; return a word for ``kept`` to look up."""
        return int(text) if text.isascii() and text.isdecimal() else text


@dataclass(frozen=True, slots=True)
class Flag(_AsWritten):
    unit: str = ""
    valid: str = "true | false"

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of a boolean."""
        return {"type": "boolean"}

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
    """A text of ``least`` to ``most`` characters; ``valid`` describes it."""

    valid: str
    unit: str = ""
    least: int = 0
    most: int = 0  # 0: any number

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of a text."""
        return _sized("string", "Length", self.least, self.most)

    def kept(self, plain: object) -> str:
        if not isinstance(plain, str) or "\0" in plain:
            raise SettingError(f"not a text: {self.valid}")
        _check_size(plain, self.least, self.most, "characters")
        return plain


@dataclass(frozen=True, slots=True)
class Items(_AsWritten):
    """A JSON list of ``least`` to ``most`` items; ``item`` is their JSON schema."""

    item: Mapping[str, Any]
    least: int
    most: int
    unit: str = ""
    valid: str = "a list"

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the list."""
        return _sized("array", "Items", self.least, self.most) | {"items": dict(self.item)}

    def kept(self, plain: object) -> list[Any]:
        """Return the list; its items are not checked."""
        if not isinstance(plain, list):
            raise SettingError("not a list")
        _check_size(plain, self.least, self.most, "items")
        return plain


def _sized(kind: str, of: str, least: int, most: int) -> dict[str, Any]:
    bounds = {f"min{of}": least, f"max{of}": most}
    return {"type": kind, **{name: bound for name, bound in bounds.items() if bound}}


def _check_size(value: Sized, least: int, most: int, what: str) -> None:
    if len(value) < least or len(value) > (most or inf):
        bounds = f"{least} to {most}" if least else f"at most {most}"
        raise SettingError(f"expected {bounds} {what}")


@dataclass(frozen=True, slots=True)
class Record(_AsWritten):
    """A JSON object, whose parts are not checked."""

    unit: str = ""
    valid: str = "an object"

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of an object."""
        return {"type": "object"}

    def kept(self, plain: object) -> dict[str, Any]:
        if not isinstance(plain, dict):
            raise SettingError("not an object")
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
