"""MAVLink messages as JSON, with the names of their definitions.

A float has nine digits, which determine its bits. JSON has no NaN and no infinity: they
are null. Each kind of message has a format string, which takes a fifth of the time of ``json``.
"""

import json
from collections.abc import Callable, Iterable
from math import isfinite
from operator import attrgetter
from typing import Any

from mav_tasks.mavlink.messages import Message

_FORMATS = {"float": "%.9g", "double": "%.17g", "char": "%s"}  # any other is an integer


class MessageJson:
    """The JSON form of one kind of message."""

    def __init__(self, kind: type[Message]) -> None:
        self._get = attrgetter(*kind.fieldnames) if len(kind.fieldnames) > 1 else None
        self._only = kind.fieldnames[0]
        self._convert: list[tuple[int, Callable[[Any], Iterable[Any]]]] = []
        formats: list[str] = []
        parts: list[str] = []
        lengths = array_lengths(kind)
        for index, name in enumerate(kind.fieldnames):
            form = _FORMATS.get(kind.fieldtypes[index], "%d")
            length = lengths[name]
            if form == "%s":
                self._convert.append((index, _text))
                formats.append(form)
                parts.append(f'"{name}":%s')
            elif length:
                self._convert.append((index, list))
                formats += [form] * length
                parts.append(f'"{name}":[{",".join(["%s"] * length)}]')
            else:
                formats.append(form)
                parts.append(f'"{name}":%s')
        #: with %s for each value, for messages with one that is not finite
        self._any = f"{{{','.join(parts)}}}"
        self._formats = formats
        self._fast = self._any % tuple(formats)
        self._floats = [i for i, form in enumerate(formats) if form.endswith("g")]

    def encode(self, message: Message) -> bytes:
        """Return a message as JSON."""
        values = self._values(message)
        if self._floats and not all(isfinite(values[index]) for index in self._floats):
            return (self._any % tuple(map(_plain, self._formats, values))).encode()
        return (self._fast % values).encode()

    def _values(self, message: Message) -> tuple[Any, ...]:
        if self._get is None:
            values: tuple[Any, ...] = (getattr(message, self._only),)
        else:
            values = self._get(message)
        if not self._convert:
            return values
        flat: list[Any] = []
        start = 0
        for index, convert in self._convert:
            flat += values[start:index]
            flat += convert(values[index])
            start = index + 1
        flat += values[start:]
        return tuple(flat)


def array_lengths(kind: type[Message]) -> dict[str, int]:
    """Return the length of each field's array, 0 for a single value."""
    # the class has them in the order of the wire
    return dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))


def _text(value: str) -> Iterable[str]:
    return (json.dumps(value),)


def _plain(form: str, value: Any) -> str:
    return "null" if form.endswith("g") and not isfinite(value) else form % value
