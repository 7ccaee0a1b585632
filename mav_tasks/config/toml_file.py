"""Reads a TOML file as values for keys, each with its line number."""

import re
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mav_tasks.basics.errors import ConfigError
from mav_tasks.config import toml_lines
from mav_tasks.config.given import Layer, Source, shown, suggestion
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.settings import KEYS, TABLES

LARGEST = 256_000  # bytes, maximum size of a file
MOST_FAULTS = 50  # reported for one file
#: a key of 33 parts or more: ``tomllib`` needs memory by the square of their number
_DEEP = re.compile(r"""(?<![\w"'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_AT_LINE = re.compile(r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", re.DOTALL)
_KEYS = {tuple(name.split(".")): key for name, key in KEYS.items()}
_TABLES = {path[:count] for path in _KEYS for count in range(1, len(path))}


def read_text(path: Path) -> str:
    """Return the text of a file; raise ConfigError if it cannot be read."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # a pipe may block, or be readable only once
            raise ConfigError(f"{path}: not a file")
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    return decoded(data, name=str(path))


def decoded(data: bytes, *, name: str) -> str:
    """Return the text of a file's bytes; raise ConfigError if too large or not UTF-8."""
    if len(data) > LARGEST:
        raise ConfigError(f"{name}: larger than {LARGEST // 1000} kB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{name}:{line}: not UTF-8") from error


class Parsed(NamedTuple):
    """A parsed TOML text: the file's name, the values, and the line of each key and table."""

    name: str
    values: Mapping[str, Any]
    lines: Mapping[toml_lines.Path, int]

    def where(self, *path: str) -> str:
        """Return the place of a key or table, for a message."""
        return f"{self.name}:{self.lines[path]}" if path in self.lines else self.name


def parsed(text: str, *, name: str) -> Parsed:
    """Parse a TOML text; raise ConfigError, with the file's ``name``, if it is invalid.

    The error quotes at most one character of the text, which may contain secrets.
    """
    if deep := _DEEP.search(text):
        line = text.count("\n", 0, deep.start()) + 1
        raise ConfigError(f"{name}:{line}: a key with too many parts")
    try:
        return Parsed(name, tomllib.loads(text), toml_lines.lines_of(text.replace("\r\n", "\n")))
    except RecursionError:
        raise ConfigError(f"{name}: tables or lists are nested too deep") from None
    except ValueError as error:  # also from int(): a number of thousands of digits
        last = len(text.rstrip().splitlines()) or 1
        raise ConfigError(_fault_of(str(error), name, last=last)) from None


def layer_of(text: str, *, name: str) -> Layer:
    """Return the layer of a TOML text; ``name``: the file's, for the faults."""
    layer = Layer(Source.FILE)
    try:
        found = parsed(text, name=name)
    except ConfigError as error:
        layer.faults += error.faults
    else:
        _walk(layer, (), found.values, found)
    return layer


def _walk(layer: Layer, before: toml_lines.Path, table: Mapping[str, Any], found: Parsed) -> None:
    for last, value in table.items():
        if len(layer.faults) == MOST_FAULTS:
            layer.faults.append(f"{found.name}: there are more errors")
        if len(layer.faults) > MOST_FAULTS:
            return
        path = (*before, last)
        where = found.where(*path)
        if path in _KEYS:
            layer.take(_KEYS[path], value, where)
        elif path not in _TABLES:
            words = shown(".".join(map(_quoted, path)))
            what = "table" if isinstance(value, dict) else "key"
            known = TABLES if what == "table" and not before else KEYS
            layer.faults.append(f"{where}: {words}: no such {what}{suggestion(words, known)}")
        elif not isinstance(value, dict):
            words = ".".join(map(str, path))
            layer.faults.append(f"{where}: {words}: expected a table, [{words}]")
        else:
            _walk(layer, path, value, found)


def _quoted(part: str) -> str:
    return part if _BARE.fullmatch(part) else literal(part)


def _fault_of(words: str, name: str, *, last: int) -> str:
    found = _AT_LINE.fullmatch(words)
    where, words = (f"{name}:{found[2] or last}", found[1]) if found else (name, words)
    return f"{where}: {''.join(each if each.isprintable() else '?' for each in words)}"
