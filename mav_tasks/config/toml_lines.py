"""Finds the line of each key in a TOML text, because ``tomllib`` does not report lines.

It skips values, and relies on ``tomllib`` having accepted the text.
"""

import re
import tomllib
from collections.abc import Mapping

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


def lines_of(text: str) -> Mapping[Path, int]:
    """Return the line, counted from 1, of each key and table, by path; of the first mention."""
    lines: dict[Path, int] = {}
    #: the table, then the inline tables and lists (None) that are open
    scopes: list[Path | None] = [()]
    key: Path | None = ()  # as far as it is read; None in a value
    path: Path = ()  # of the value
    line = 1
    for token in _TOKEN.finditer(text):
        match token[0]:
            case "\n" if len(scopes) == 1:
                key = scopes[0]
            case "[" if len(scopes) == 1 and key is not None:  # of a table
                scopes, key = [()], ()
            case "]" if len(scopes) == 1 and key is not None:
                scopes = [key]
            case "[":
                scopes.append(None)
            case "{":
                key = None if scopes[-1] is None else path
                scopes.append(key)
            case "]" | "}" if len(scopes) > 1:
                scopes.pop()
                key = None
            case ",":
                key = scopes[-1]
            case "=" if key is not None:
                path, key = key, None
            case name if token.lastgroup in ("bare", "text") and key is not None:
                if len(key) < DEEPEST:
                    key = (*key, _name(name))
                    lines.setdefault(key, line)
        line += token[0].count("\n")
    return lines


def _name(text: str) -> str:
    """Return the name of a bare or quoted part of a key."""
    if not text.startswith('"'):
        return text.strip("'")
    return str(tomllib.loads(f"x = {text}")["x"])
