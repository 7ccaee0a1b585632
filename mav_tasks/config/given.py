"""What one source says: values for keys, and all that is wrong with it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import Enum

from mav_tasks.errors import SettingError
from mav_tasks.setting_keys.key import Key
from mav_tasks.setting_keys.literals import literal

LONGEST = 60  # characters of what is wrong that are shown


class Source(Enum):
    """Who says a value; each comes before the one above it."""

    DEFAULT = "default"
    FILE = "file"
    ENVIRONMENT = "environment"
    FLAG = "flag"
    PARAMETER = "parameter"


@dataclass(frozen=True, slots=True)
class Given:
    """A value that a source gives to a key; ``where`` in words, such as ``config.toml:3``."""

    key: Key
    kept: object
    source: Source
    where: str

    def names(self) -> str:
        """Return where it stands and, unless that says it, of which key."""
        return f"{self.where}: {self.key.name}" if self.source is Source.FILE else self.where


@dataclass(slots=True)
class Layer:
    """All that one source gives, by the key's name, and its faults."""

    source: Source
    given: dict[str, Given] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    #: keys whose value here is none
    faulty: set[str] = field(default_factory=set)

    def take(self, key: Key, plain: object, where: str) -> None:
        """Take a plain value, or note what is wrong with it."""
        try:
            given = Given(key, key.shape.kept(plain), self.source, where)
        except SettingError as error:
            equals = " = " if self.source is Source.FILE else "="
            names = Given(key, None, self.source, where).names()
            self.refuse(key, f"{names}{equals}{shown(plain)}: {error}")
        else:
            self.given[key.name] = given

    def read(self, key: Key, text: str, where: str) -> None:
        """Take a value from a text, or note what is wrong with it."""
        try:
            plain = key.shape.read(text)
        except SettingError as error:
            self.refuse(key, f"{where}={shown(text)}: {error}")
        else:
            self.take(key, plain, where)

    def refuse(self, key: Key, fault: str) -> None:
        """Note that what is said of a key is wrong."""
        self.faulty.add(key.name)
        self.faults.append(fault)


def shown(plain: object) -> str:
    """Return a value on one line, and not too much of it."""
    try:
        words = plain if isinstance(plain, str) and plain.isprintable() else literal(plain)
    except (ValueError, RecursionError):  # a number of thousands of digits, a list in lists
        words = f"a {type(plain).__name__} too large to show"
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 1]}…"


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean …?" if a known name is near, else nothing."""
    names = list(known)
    near = get_close_matches(name[:LONGEST], names, n=1) or [
        each for each in names if each.rpartition(".")[2] == name
    ]
    return f"; did you mean {near[0]}?" if near else ""


def by_path(keys: Mapping[str, Key]) -> dict[tuple[str, ...], Key]:
    """Return keys by the parts of their names."""
    return {tuple(name.split(".")): key for name, key in keys.items()}
