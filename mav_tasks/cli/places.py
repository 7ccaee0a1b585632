"""Parse a typed place: metres from the rover's origin, or latitude and longitude."""

from math import hypot

from mav_tasks.basics.errors import UsageError
from mav_tasks.kinds import GlobalPlace, LocalPlace, Place

#: m; numbers of a place farther from the origin may be degrees
NEAR = 20.0
#: decimals from which on numbers may be degrees
DEGREES = 3


def parse_place(first: str, second: str, *, is_global: bool, is_local: bool) -> Place:
    """Return the place of two numbers.

    Raise UsageError for invalid numbers, and for numbers that may be metres or degrees: 47.3977
    8.5456 as metres is 48 m to the north-east.
    """
    if is_global and is_local:
        raise UsageError("--global and --local: choose one of them")
    numbers = _number("NORTH|LAT", first), _number("EAST|LON", second)
    if is_global:
        return GlobalPlace(_degE7("latitude", numbers[0], 90), _degE7("longitude", numbers[1], 180))
    if not is_local and _may_be_degrees(first, second, numbers):
        raise UsageError(
            f"goto {first} {second}: is this latitude and longitude? Add --global;"
            " if it is metres north and east, add --local"
        )
    return LocalPlace(*numbers)


def _may_be_degrees(first: str, second: str, numbers: tuple[float, float]) -> bool:
    are_exact = any(len(text.partition(".")[2]) >= DEGREES for text in (first, second))
    fit = abs(numbers[0]) <= 90 and abs(numbers[1]) <= 180
    return fit and (are_exact or hypot(*numbers) > NEAR)


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{name} {text!r}: expected a number") from None


def _degE7(name: str, value: float, limit: int) -> int:
    if not abs(value) <= limit:
        raise UsageError(f"{name} {value:g}: expected degrees, -{limit} to {limit}")
    return round(value * 1e7)
