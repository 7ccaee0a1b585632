"""Random messages of every kind, made and packed by the stock dialect of pymavlink.

It shares no code with ours: it was generated from other definitions, by somebody else.
"""

import struct
from random import Random
from typing import Any

from pymavlink.dialects.v20 import common

INTEGERS = {
    "uint8_t": (0, 0xFF),
    "int8_t": (-0x80, 0x7F),
    "uint16_t": (0, 0xFFFF),
    "int16_t": (-0x8000, 0x7FFF),
    "uint32_t": (0, 0xFFFFFFFF),
    "int32_t": (-0x80000000, 0x7FFFFFFF),
    "uint64_t": (0, 0xFFFFFFFFFFFFFFFF),
    "int64_t": (-0x8000000000000000, 0x7FFFFFFFFFFFFFFF),
    "uint8_t_mavlink_version": (0, 0xFF),
}

MessageClass = Any  # pymavlink's classes carry no type information


def values_of(kind: MessageClass, random: Random) -> list[Any]:
    """Random constructor arguments; half of the fields are 0, as they often are in life."""
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return [
        _value(field_type, _length(kind, lengths, name), random)
        for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    ]


def stock_message(random: Random, *, v1: bool = False) -> Any:
    """A message of a random kind; of those that MAVLink 1 can number, if asked."""
    kinds = [kind for number, kind in common.mavlink_map.items() if not v1 or number < 256]
    kind = random.choice(kinds)
    return kind(*values_of(kind, random))


def stock_packet(
    message: Any, *, seq: int, source: tuple[int, int] = (1, 1), v1: bool = False
) -> bytes:
    """The packet that stock pymavlink makes of a message."""
    mav = common.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
    mav.seq = seq
    packed: bytes = message.pack(mav, force_mavlink1=v1)
    return packed


def _length(kind: MessageClass, lengths: dict[str, int], name: str) -> int:
    """Array length, of texts too: those are counted in the struct's format only."""
    return lengths[name] or _text_length(kind, name)


def _text_length(kind: MessageClass, name: str) -> int:
    if dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))[name] != "char":
        return 0
    texts = [
        field
        for field in kind.ordered_fieldnames
        if dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))[field] == "char"
    ]
    sizes = [part for part in _format_parts(kind.unpacker.format) if part.endswith("s")]
    return int(sizes[texts.index(name)].removesuffix("s") or 1)


def _format_parts(text: str) -> list[str]:
    parts, number = [], ""
    for letter in text.lstrip("<"):
        if letter.isdigit():
            number += letter
        else:
            parts.append(number + letter)
            number = ""
    return parts


def _value(field_type: str, length: int, random: Random) -> Any:
    if field_type == "char":
        size = random.randint(0, length)
        return bytes(random.choice(b"abcdefghijklmnopqrstuvwxyz 0123456789") for _ in range(size))
    if length:
        return [_scalar(field_type, random) for _ in range(length)]
    return _scalar(field_type, random)


def _scalar(field_type: str, random: Random) -> float:
    if random.random() < 0.5:
        return 0
    if field_type == "float":
        value: float = struct.unpack("<f", struct.pack("<f", random.uniform(-1e6, 1e6)))[0]
        return value
    if field_type == "double":
        return random.uniform(-1e12, 1e12)
    low, high = INTEGERS[field_type]
    return random.randint(low, high)
