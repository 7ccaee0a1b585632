"""Reads the parameters of a command; a Rejection names the bad one. Pure functions.

MAVLink common.xml: NaN is "not given".
"""

from collections.abc import Callable, Mapping, Sequence
from math import degrees, isinf, isnan, radians
from typing import Any, Protocol

from mav_tasks.basics.errors import BAD_FRAME, BAD_PARAMETER, Rejection
from mav_tasks.config.settings import Driving
from mav_tasks.kinds.places import LOCAL_SCALE, GlobalPlace, LocalPlace, Place
from mav_tasks.mavlink.enums import MavFrame
from mav_tasks.mavlink.float_param import EXACT, LARGEST, large_number

#: a COMMAND_INT without coordinates may name any existing frame
KNOWN_FRAMES = frozenset(MavFrame)
GLOBAL_FRAMES = frozenset(frame for frame in MavFrame if frame.name.startswith("GLOBAL"))
NOT_GIVEN = 0x7FFFFFFF  # x and y of COMMAND_INT, whose integers have no NaN
MAX_WAIT = 86_400.0  # s
MIN_SPEED = 0.01  # m/s; a slower drive takes minutes for a metre, and counts as stuck
MIN_RATE = 0.1  # deg/s, the same for turning

INTEGERS = (5, 6)  # x and y of COMMAND_INT


class Given(Protocol):
    """A command: its seven parameters, and the frame of a COMMAND_INT or an item, else None."""

    @property
    def params(self) -> Sequence[float]: ...

    @property
    def frame(self) -> int | None: ...


#: makes a goal of a command, by the command's number
Parsers = Mapping[int, Callable[[Given, Driving], Any]]


def bad(words: str, *, param: int) -> Rejection:
    """Return a Rejection for a parameter, 1 to 7."""
    return Rejection(BAD_PARAMETER, words, param=param)


def number(
    command: Given,
    index: int,
    name: str,
    *,
    low: float,
    high: float,
    default: float | None = None,
) -> float:
    """Return a parameter, or raise Rejection that names it. NaN is "not given"."""
    value = command.params[index - 1]
    if low <= value <= high:
        return value
    label = f"param{index} {name}"
    if not isnan(value):
        raise bad(f"{label} {value:.8g} not in {low:.8g}..{high:.8g}", param=index)
    if default is None:
        raise bad(f"{label} is not given", param=index)
    return default


def whole(
    command: Given, index: int, name: str, *, high: int, low: int = 0, default: int | None = 0
) -> int:
    """Return a whole-number parameter, or raise Rejection that names it.

    ``default`` None: it must be given.
    """
    value = command.params[index - 1]
    if low <= value <= high and value == int(value):
        return int(value)
    fallback = None if default is None else float(default)
    value = number(command, index, name, low=low, high=high, default=fallback)
    if value != int(value):
        raise bad(f"param{index} {name} {value:.8g} is not a whole number", param=index)
    return int(value)


def identifier(
    command: Given, index: int, name: str, *, low: int = 0, default: int | None = 0
) -> int:
    """Return a task id or nonce, a whole number that may exceed the range of a float32."""
    value = command.params[index - 1]
    if low <= value <= EXACT and value == int(value):
        return int(value)
    is_integer = command.frame is not None and index in INTEGERS
    large = None if is_integer else large_number(value)
    if large is not None:
        return large
    high = LARGEST if is_integer else EXACT
    return whole(command, index, name, low=low, high=high, default=default)


def flag(command: Given, index: int, name: str, *, default: int | None = 0) -> bool:
    """Return a parameter that is 0 or 1."""
    return whole(command, index, name, high=1, default=default) == 1


def has_place(command: Given) -> bool:
    """Whether x and y give a place, valid or not."""
    x, y = command.params[4:6]
    if command.frame is None:
        return not (isnan(x) and isnan(y))
    return not x == y == NOT_GIVEN


def place_in(command: Given) -> Place | None:
    """Return the place in x and y, or None if none is given. Raise Rejection if it is bad."""
    if not has_place(command):
        return None
    x, y = command.params[4:6]
    if command.frame is None:
        latitude = number(command, 5, "latitude", low=-90.0, high=90.0)
        longitude = number(command, 6, "longitude", low=-180.0, high=180.0)
        return _global(round(latitude * 1e7), round(longitude * 1e7))
    for value, name, param in ((x, "x", 5), (y, "y", 6)):
        if value == NOT_GIVEN:
            raise bad(f"{name} is not given", param=param)
    if command.frame == MavFrame.LOCAL_NED:
        return LocalPlace(x / LOCAL_SCALE, y / LOCAL_SCALE)
    if command.frame not in GLOBAL_FRAMES:
        raise Rejection(BAD_FRAME, f"frame {command.frame} is not supported here")
    if abs(x) > 90e7:
        raise bad(f"x latitude {x / 1e7:.7f} not in -90..90", param=5)
    if abs(y) > 180e7:
        raise bad(f"y longitude {y / 1e7:.7f} not in -180..180", param=6)
    return _global(int(x), int(y))


def _global(latitude_degE7: int, longitude_degE7: int) -> GlobalPlace:
    if latitude_degE7 == longitude_degE7 == 0:  # an unset place looks like this
        raise bad("latitude and longitude are 0: no place is given", param=5)
    return GlobalPlace(latitude_degE7, longitude_degE7)


def needed_place(command: Given) -> Place:
    place = place_in(command)
    if place is None:
        raise bad("param5 latitude, param6 longitude: not given", param=5)
    return place


def heading_in(command: Given, index: int, *, turn: float) -> float | None:
    """Return a heading of at most a full ``turn``, None if none is given.

    0 counts as none: many clients leave a 0 there without meaning north.
    """
    return number(command, index, "yaw", low=-turn, high=turn, default=0.0) or None


def speed_or_default(command: Given, index: int, driving: Driving) -> float | None:
    """Return a speed in m/s, None for the default: 0 or NaN."""
    value = command.params[index - 1]
    if value == 0.0 or isnan(value):
        return None
    return number(command, index, "speed", low=MIN_SPEED, high=driving.max_speed)


def rate_or_default(command: Given, index: int, driving: Driving) -> float | None:
    """Return a turn rate in rad/s, None for the default: 0 or NaN."""
    value = command.params[index - 1]
    if value == 0.0 or isnan(value):
        return None
    fastest = degrees(driving.max_turn_rate)
    return radians(number(command, index, "rate", low=MIN_RATE, high=fastest))


def refuse_infinite(command: Given) -> None:
    """Raise Rejection for an infinite parameter, also an unused one: it cannot be meant."""
    for index, value in enumerate(command.params, 1):
        if isinf(value):
            raise bad(f"param{index} is infinite", param=index)


def refuse_reserved(command: Given, index: int) -> None:
    """Raise Rejection if a reserved parameter is set: it must not be ignored silently."""
    value = command.params[index - 1]
    if value != 0.0 and not isnan(value):
        raise bad(f"param{index} (unused): must be 0 in this version", param=index)
