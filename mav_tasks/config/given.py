"""The values that one source gives to keys, and the faults of the source."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import Enum

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.key import Key
from mav_tasks.config.setting_keys.literals import literal

LONGEST = 60  # characters shown of a wrong value


class Source(Enum):
    """The kinds of sources; each overrides the ones above it."""

    DEFAULT = "default"
    FILE = "file"
    ENVIRONMENT = "environment"
    FLAG = "flag"
    PARAMETER = "parameter"


@dataclass(frozen=True, slots=True)
class Given:
    """A value that a source gives to a key; ``where``: the place, such as ``config.toml:3``."""

    key: Key
    kept: object
    source: Source
    where: str

    def names(self) -> str:
        """Return the place for a message, with the key's name if the place lacks it."""
        return f"{self.where}: {self.key.name}" if self.source is Source.FILE else self.where


@dataclass(slots=True)
class Layer:
    """The values of one source by key name, and its faults."""

    source: Source
    given: dict[str, Given] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    #: names of keys with an invalid value in this source
    faulty: set[str] = field(default_factory=set)

    def take(self, key: Key, plain: object, where: str) -> None:
        """Add a plain value, or note its fault."""
        try:
            given = Given(key, key.shape.kept(plain), self.source, where)
        except SettingError as error:
            equals = " = " if self.source is Source.FILE else "="
            names = Given(key, None, self.source, where).names()
            self.refuse(key, f"{names}{equals}{shown(plain)}: {error}")
        else:
            self.given[key.name] = given

    def read(self, key: Key, text: str, where: str) -> None:
        """Parse a text and add its value, or note its fault."""
        try:
            plain = key.shape.read(text)
        except SettingError as error:
            self.refuse(key, f"{where}={shown(text)}: {error}")
        else:
            self.take(key, plain, where)

    def refuse(self, key: Key, fault: str) -> None:
        self.faulty.add(key.name)
        self.faults.append(fault)


def shown(plain: object) -> str:
    """Return a value as text on one line, cut to LONGEST."""
    try:
        words = plain if isinstance(plain, str) and plain.isprintable() else literal(plain)
    except (ValueError, RecursionError):  # thousands of digits, or deeply nested lists
        words = f"a {type(plain).__name__} too large to show"
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 1]}…"


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean …?" if a known name is similar, else ""."""
    names = list(known)
    near = get_close_matches(name[:LONGEST], names, n=1) or [
        each for each in names if each.rpartition(".")[2] == name
    ]
    return f"; did you mean {near[0]}?" if near else ""
