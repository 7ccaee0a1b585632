"""Formats plain values as TOML. Pure."""

from math import isfinite


def in_digits(value: float) -> str:
    """Return a number without an exponent or a needless ``.0``: 100000, 0.05."""
    return str(int(value)) if isfinite(value) and value == int(value) else repr(value)


def literal(plain: object) -> str:
    """Return a plain value as TOML."""
    match plain:
        case bool():
            return "true" if plain else "false"
        case int():
            return str(plain)
        case float():
            return in_digits(plain)
        case str():
            return _quoted(plain)
        case list():
            return f"[{', '.join(map(literal, plain))}]"
        case dict():
            pairs = ", ".join(f"{_quoted(key)} = {literal(each)}" for key, each in plain.items())
            return f"{{ {pairs} }}" if pairs else "{}"
        case _:
            return _quoted(str(plain))


_SHORT = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def _quoted(text: str) -> str:
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in _SHORT:
        return _SHORT[character]
    return character if character.isprintable() else f"\\U{ord(character):08x}"
