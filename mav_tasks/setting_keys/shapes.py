"""What values a setting can have. Pure.

A value is *plain* as people and TOML write it (degrees, days, lists), and *kept* as the settings
have it (radians, seconds, tuples). SettingError says what is wrong with a plain one, not of which
setting: its caller knows.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from mav_tasks.errors import SettingError
from mav_tasks.setting_keys.literals import in_digits, literal

#: MAVLink address, perhaps with an endpoint: as ``Submitter`` writes itself
CLIENT = re.compile(r"(\d{1,3})/(\d{1,3})(@[^\s@=,]+)?")
HIGHEST_PRIORITY = 10
HIGHEST_ID = 255


class Shape(Protocol):
    """One kind of values."""

    @property
    def unit(self) -> str:
        """The unit of a plain value, "" for none."""

    @property
    def valid(self) -> str:
        """Which plain values there are, in words."""

    def kept(self, plain: object) -> Any:
        """Return what the settings keep of a plain value; SettingError."""

    def plain(self, kept: Any) -> object:
        """Return the plain value of what the settings keep."""

    def read(self, text: str) -> object:
        """Return the plain value that a text means; SettingError."""


@dataclass(frozen=True, slots=True)
class Number:
    """A number from ``low`` to ``high``; ``scale`` times that is kept.

    ``none`` is a word that means that there is no limit, kept as None.
    """

    low: float
    high: float
    unit: str = ""
    scale: float = 1.0
    is_whole: bool = False
    none: str = ""

    @property
    def valid(self) -> str:
        """Its range."""
        words = f"{in_digits(self.low)}..{in_digits(self.high)}"
        words += f" {self.unit}" if self.unit else ""
        words += ", whole" if self.is_whole else ""
        return words + (f', or "{self.none}"' if self.none else "")

    def kept(self, plain: object) -> float | None:
        """Return it in the unit of the settings."""
        if self.none and plain == self.none:
            return None
        if isinstance(plain, bool) or not isinstance(plain, int | float):
            raise SettingError(f"not a number: {self.valid}")
        if not self.low <= plain <= self.high:  # NaN is neither
            raise SettingError(f"not in {self.valid}")
        if not self.is_whole:
            return float(plain) * self.scale
        if plain != int(plain):
            raise SettingError(f"not a whole number: {self.valid}")
        return int(plain)

    def plain(self, kept: float | None) -> object:
        """Return the number that was written: 40 degrees, not 39.99999999."""
        if kept is None:
            return self.none
        return kept if self.is_whole else float(f"{kept / self.scale:.12g}")

    def read(self, text: str) -> object:
        """Read a number, or the word for none."""
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
class Choice:
    """One of some words."""

    words: tuple[str, ...]
    unit: str = ""

    @property
    def valid(self) -> str:
        """The words."""
        return " | ".join(f'"{word}"' for word in self.words)

    def kept(self, plain: object) -> str:
        """Return the word."""
        if plain not in self.words:
            raise SettingError(f"expected one of {', '.join(self.words)}")
        return str(plain)

    def plain(self, kept: str) -> object:
        """Return the word."""
        return kept

    def read(self, text: str) -> object:
        """Take it as it is."""
        return text


@dataclass(frozen=True, slots=True)
class Flag:
    """Yes or no."""

    unit: str = ""
    valid: str = "true | false"

    def kept(self, plain: object) -> bool:
        """Return it, if it is one."""
        if not isinstance(plain, bool):
            raise SettingError("expected true or false")
        return plain

    def plain(self, kept: bool) -> object:
        """Return it as it is."""
        return kept

    def read(self, text: str) -> object:
        """Read "true" or "false", in any case."""
        return {"true": True, "false": False}.get(text.lower(), text)


@dataclass(frozen=True, slots=True)
class Text:
    """A text, of which ``valid`` says what it is to be; an empty one has a meaning, too."""

    valid: str
    unit: str = ""

    def kept(self, plain: object) -> str:
        """Return the text."""
        if not isinstance(plain, str) or "\0" in plain:
            raise SettingError(f"not a text: {self.valid}")
        return plain

    def plain(self, kept: str) -> object:
        """Return the text."""
        return kept

    def read(self, text: str) -> object:
        """Take it as it is."""
        return text


@dataclass(frozen=True, slots=True)
class Texts:
    """Texts in an order; as one text they stand with commas between them."""

    valid: str
    least: int = 0  # how many there are
    words: tuple[str, ...] = ()  # the only ones there are, if not all
    unit: str = ""

    def kept(self, plain: object) -> tuple[str, ...]:
        """Return them as a tuple."""
        if not isinstance(plain, list) or not all(isinstance(each, str) for each in plain):
            raise SettingError(f"not a list of texts: {self.valid}")
        if len(plain) < self.least:
            raise SettingError(f"fewer than {self.least}: {self.valid}")
        unknown = [each for each in plain if self.words and each not in self.words]
        if unknown:
            raise SettingError(f"{unknown[0]!a}: expected {self.valid}")
        return tuple(plain)

    def plain(self, kept: tuple[str, ...]) -> object:
        """Return them as a list."""
        return list(kept)

    def read(self, text: str) -> object:
        """Split at commas; nothing at all is an empty list."""
        return [each.strip() for each in text.split(",")] if text.strip() else []


@dataclass(frozen=True, slots=True)
class ByClient:
    """A value for each of some clients; as one text ``255/190=7,245/190=3``."""

    each: Shape
    example: object
    unit: str = ""

    @property
    def valid(self) -> str:
        """An example, and what each may be."""
        value = literal(self.example)
        clients = f'{{ "255/190" = {value}, "255/190@127.0.0.1:14550" = {value} }}'
        return f"{clients}, each {self.each.valid}"

    def kept(self, plain: object) -> Mapping[str, Any]:
        """Return them by client."""
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
        """Return them as a table."""
        return {client: self.each.plain(value) for client, value in kept.items()}

    def read(self, text: str) -> object:
        """Split at commas, and each at its last equals sign."""
        values: dict[str, object] = {}
        for each in text.split(",") if text.strip() else ():
            client, _, value = each.strip().rpartition("=")
            values[client] = self.each.read(value)
        return values
