"""Numbers as a mission file has them: the shortest that reads back as the same on the wire."""

from decimal import Decimal
from math import isfinite, nan
from struct import pack, unpack

from mav_tasks.plans.entries import AXES, PLAIN, Axis

NOT_GIVEN = 0x7FFFFFFF  # of x and y of MISSION_ITEM_INT, which have no NaN
FEW_DIGITS = range(6, 9)
ALL_DIGITS = 9  # these tell every float32


def shortest(value: float) -> float:
    """Return the float with the fewest digits that is the same float32, if it came from one."""
    if not isfinite(value) or unpack("<f", pack("<f", value))[0] != value:
        return value
    for digits in FEW_DIGITS:
        candidate = float(f"{value:.{digits}g}")
        if pack("<f", candidate) == pack("<f", value):
            return candidate
    return float(f"{value:.{ALL_DIGITS}g}")


def place(frame: int, x: int, y: int) -> tuple[float, float]:
    """Return x and y in degrees or m, as the frame has them: the inverse of ``entries.scaled``."""
    axes = AXES.get(frame, PLAIN)
    return unscaled(x, axes[0]), unscaled(y, axes[1])


def unscaled(value: int, axis: Axis) -> float:
    """Return one of them, NaN for "not given"."""
    if value == NOT_GIVEN:
        return nan
    return float(Decimal(value).scaleb(-axis.digits))
