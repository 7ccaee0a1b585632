"""Whole numbers of 30 bits in a float32 parameter of a command.

A float32 holds whole numbers up to 16,777,215 exactly: those are sent as they are. A larger one is
sent as the float32 that has its bits and the sign bit set, a number between -1 and 0. MAVLink knows
such bytes in floats from parameters (PARAM_ENCODE_BYTEWISE).

>>> to_param(7), to_param(0x01000000)
(7.0, -2.350988701644575e-38)
"""

from struct import Struct

EXACT = 0xFFFFFF  # every whole number up to here is one in a float32
LARGEST = 0x3F7FFFFF  # with the sign bit: the last float32 above -1
_SIGN = 0x80000000

_FLOAT, _BITS = Struct("<f"), Struct("<I")


def to_param(number: int) -> float:
    """Return the parameter that says a whole number from 0 to LARGEST; others are out of range."""
    if not EXACT < number <= LARGEST:
        return float(number)
    value: float = _FLOAT.unpack(_BITS.pack(number | _SIGN))[0]
    return value


def large_number(value: float) -> int | None:
    """Return the number above EXACT that a parameter says by its bits; None: it says none so."""
    if not -1.0 < value < 0.0:
        return None
    number: int = _BITS.unpack(_FLOAT.pack(value))[0] & ~_SIGN
    return number if number > EXACT else None
