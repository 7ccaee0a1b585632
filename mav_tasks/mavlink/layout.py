"""How one kind of message lies on the wire: payload bytes ↔ field values.

It uses the generated class's own ``struct`` and field order, and leaves out what pymavlink's
``decode`` and ``pack`` do around them (copies, header objects, sums over arrays for each field):
those took a quarter of the server's time under load. Tested equal to pymavlink's for every message.
"""

from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter, itemgetter
from typing import Any

from mav_tasks.mavlink.messages import Message

_Values = Sequence[Any]


class Layout:
    """The wire layout of one message class."""

    __slots__ = ("crc_extra", "message", "order", "struct", "values")

    def __init__(self, message: type[Message]) -> None:
        self.message = message
        self.struct = message.unpacker
        self.crc_extra = bytes((message.crc_extra,))
        is_plain = sum(message.lengths) == len(message.lengths)
        has_text = "char" in message.fieldtypes
        #: gives the fields of a message, as its class takes them, of the values in wire order
        self.order = _orderly(message, is_plain=is_plain, has_text=has_text)
        #: gives a message's values in wire order, arrays flattened
        self.values = _getter(message, is_plain=is_plain)


def _orderly(
    message: type[Message], *, is_plain: bool, has_text: bool
) -> Callable[[_Values], _Values]:
    """Return what turns values in wire order into values in the order of definition."""
    if is_plain and not has_text and len(message.orders) > 1:
        if message.orders == sorted(message.orders):
            return tuple
        return itemgetter(*message.orders)
    if is_plain and not has_text:
        return tuple
    starts = [sum(message.lengths[:order]) for order in message.orders]
    lengths = [message.lengths[order] for order in message.orders]

    def ordered(values: _Values) -> _Values:
        fields: list[Any] = []
        for start, length in zip(starts, lengths, strict=True):
            value = values[start]
            if isinstance(value, bytes):
                value = value.rstrip(b"\0")
            elif length > 1:
                value = list(values[start : start + length])
            fields.append(value)
        return fields

    return ordered


def _getter(message: type[Message], *, is_plain: bool) -> Callable[[Message], Iterable[Any]]:
    """Return what takes a message's values in wire order, arrays flattened."""
    types = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    # under its own name a text is a str: its bytes, which need not be UTF-8, are kept beside it
    names = [f"_{n}_raw" if types[n] == "char" else n for n in message.ordered_fieldnames]
    get = attrgetter(*names)
    if is_plain and len(names) > 1:
        return get
    if len(names) == 1:
        return lambda message: (get(message),)
    return lambda message: _flat(get(message))


def _flat(values: Iterable[Any]) -> Iterable[Any]:
    for value in values:
        if isinstance(value, (list, tuple)):
            yield from value
        else:
            yield value
