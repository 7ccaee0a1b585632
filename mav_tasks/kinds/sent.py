"""How a goal is sent: as mission items, in the units and parameters of the dialect."""

from dataclasses import fields, is_dataclass
from math import isfinite
from types import NoneType
from typing import Any, NamedTuple, get_args

from mav_tasks.mavlink.enums import MavFrame

LARGEST = 0x7FFFFFFE  # largest x and y; INT32_MAX means "not given"
#: numbers between these are float32s, also in degrees; others become 0 or infinite
LEAST, MOST = 1e-37, 1e36
EXACT = ("yaw", "north", "east")  # sent as integers, or else as north


class Sent(NamedTuple):
    """An item. Its command, with the first three parameters, also submits a goal of its own."""

    command: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    frame: int = MavFrame.MISSION
    x: int = 0
    y: int = 0
    z: float = 0.0


def check_numbers(goal: Any) -> None:
    """Raise ValueError unless all numbers of a goal, or a place, can be sent."""
    for field in fields(goal):
        value, kinds = getattr(goal, field.name), (field.type, *get_args(field.type))
        if is_dataclass(value):
            check_numbers(value)
        elif float in kinds and isinstance(value, tuple):
            continue  # its kind checks them
        elif float in kinds and not (value is None and NoneType in kinds):
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise ValueError(f"{goal}: {field.name} is not a number")
            if field.name not in EXACT:
                check_size(field.name, value)


def check_size(name: str, value: float) -> None:
    """Raise ValueError for a number that a float32 makes 0, which means "default", or infinite."""
    if value and not LEAST <= abs(value) <= MOST:
        raise ValueError(
            f"{name} {value:g} is too {'small' if abs(value) < 1 else 'large'} to send"
        )
