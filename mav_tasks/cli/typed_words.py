"""Translate a server's refusal of a number into the terms of the command line.

The server names a MAVLink parameter ("param2 speed 99 not in 0.01..2"). After ``--speed 99`` the
operator reads the option, its unit, and the setting that holds the limit. A task of one goal is a
plan of one or a few items on the wire: the item numbers are left out.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from mav_tasks.basics.errors import Refused

PLACE = re.compile(r"^(.*?)item \d+ is ")
ITEM = re.compile(r"^(.*?)item \d+: ")
OUT_OF_RANGE = re.compile(r"param\d ([a-z ]+) (\S+) not in (-?[\d.e+]+)\.\.(-?[\d.e+]+)$")


class Typed(NamedTuple):
    """The option or argument of a number, its unit, and the setting that limits it."""

    name: str
    unit: str = ""
    setting: str = ""


TYPED = {
    "distance": Typed("METRES", "m", "driving.max_distance"),
    "speed": Typed("--speed", "m/s", "driving.max_speed"),
    "angle": Typed("DEGREES", "deg", "driving.max_turn_deg"),
    "rate": Typed("--rate", "deg/s", "driving.max_turn_rate_deg"),
    "forward speed": Typed("M/S", "m/s", "driving.max_speed"),
    "yaw rate": Typed("DEG/S", "deg/s", "driving.max_turn_rate_deg"),
    "duration": Typed("DURATION", "s", "driving.max_duration"),
    "hold": Typed("DURATION", "s"),
    "acceptance radius": Typed("--radius", "m"),
}


@contextmanager
def in_typed_words() -> Iterator[None]:
    """Translate the Refused errors of a block with ``typed_words``."""
    try:
        yield
    except Refused as error:
        words = typed_words(str(error))
        if words is None:
            raise
        raise Refused(words, result=error.result, reason=error.reason) from error


def typed_words(refusal: str) -> str | None:
    """Return a refusal in terms of the command line; None if it needs no translation."""
    found = OUT_OF_RANGE.search(refusal)
    typed = None if found is None else TYPED.get(found[1])
    if found is None or typed is None:
        words = ITEM.sub(r"\1", PLACE.sub(r"\1the place is ", refusal))
        return words if words != refusal else None
    value, low, high = found[2], found[3], found[4]
    limit = f"at most {high}" if float(value) > float(high) else f"at least {low}"
    unit = f" {typed.unit}" if typed.unit else ""
    setting = f" ({typed.setting})" if typed.setting else ""
    return f"{typed.name} {value}: {limit}{unit}{setting}"
