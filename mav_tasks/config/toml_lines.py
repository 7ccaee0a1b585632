"""Finds the line of each key in a TOML text, because ``tomllib`` does not report lines.

It skips values, and relies on ``tomllib`` having accepted the text.
"""

import re
import tomllib
from collections.abc import Mapping
from typing import NamedTuple

Path = tuple[str, ...]

DEEPEST = 8  # maximum parts of a recorded path; no key has so many

_TOKEN = re.compile(
    r"""
      (?P<newline>\n)
    | (?P<blank>[ \t\r]+|\#[^\n]*)
    | (?P<text>\"{3}(?:\\.|[^\\])*?\"{3,5}
        |'{3}.*?'{3,5}
        |\"(?:\\.|[^"\\\n])*\"
        |'[^'\n]*')
    | (?P<mark>[][{}=,.])
    | (?P<bare>[^\s"'\#\[\]{}=,.]+)
    | (?P<other>.)
    """,
    re.DOTALL | re.VERBOSE,
)
_OPENING, _CLOSING = ("[", "{"), ("]", "}")


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


def lines_of(text: str) -> Mapping[Path, int]:
    """Return the line, counted from 1, of each key and table, by path."""
    finder = _Finder(text)
    finder.read_all()
    return finder.lines


class _Finder:
    def __init__(self, text: str) -> None:
        self._tokens = list(_tokens(text))
        self._at = 0
        self.lines: dict[Path, int] = {}

    def read_all(self) -> None:
        table: Path = ()
        while self._at < len(self._tokens):
            if self._text() == "[":
                self._skip("[")
                table = self._key(before=())
                self._skip("]")
            elif self._kind() == "newline":
                self._at += 1
            else:
                self._pair(table)

    def _pair(self, table: Path) -> None:
        path = self._key(before=table)
        self._skip("=")
        if self._text() == "{":
            self._inline_table(path)
        elif self._text() == "[":
            self._skip_list()
        while self._text() not in ("", ",", "}") and self._kind() != "newline":
            self._at += 1

    def _inline_table(self, path: Path) -> None:
        self._at += 1
        while self._text() not in ("", "}"):
            if self._text() == "," or self._kind() == "newline":
                self._at += 1
            else:
                self._pair(path)
        self._at += 1

    def _skip_list(self) -> None:
        depth = 0
        while self._text():
            if self._kind() == "mark":
                depth += (self._text() in _OPENING) - (self._text() in _CLOSING)
            self._at += 1
            if depth == 0:
                return

    def _key(self, *, before: Path) -> Path:
        """Read a dotted key; record for each of its tables the line of the first mention."""
        path, began = before, self._at
        while self._kind() in ("bare", "text") or self._text() == ".":
            if self._text() != "." and len(path) < DEEPEST:
                path = (*path, _name(self._text()))
                self.lines.setdefault(path, self._tokens[self._at].line)
            self._at += 1
        if self._at == began:  # not TOML: skip a token, so that the loop ends
            self._at += 1
        return path

    def _skip(self, mark: str) -> None:
        while self._text() == mark:
            self._at += 1

    def _text(self) -> str:
        return self._tokens[self._at].text if self._at < len(self._tokens) else ""

    def _kind(self) -> str:
        return self._tokens[self._at].kind if self._at < len(self._tokens) else ""


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    line = 1
    for found in _TOKEN.finditer(text):
        kind = found.lastgroup or ""
        if kind != "blank":
            tokens.append(_Token(kind, found[0], line))
        line += found[0].count("\n")
    return tokens


def _name(text: str) -> str:
    """Return the name of a bare or quoted part of a key."""
    if not text.startswith('"'):
        return text.strip("'")
    return str(tomllib.loads(f"x = {text}")["x"])
