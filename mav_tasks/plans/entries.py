"""Items and places of a mission file, whichever format they come from."""

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from typing import NamedTuple

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.plans.fields import number, shown, typed, whole
from mav_tasks.plans.values import GeoPoint, PlanItem

#: NAV_WAYPOINT and the three loiters, 16 to 19: 0, 0 would be a place far away, and not "none"
PLACED = range(MavCmd.NAV_WAYPOINT, MavCmd.NAV_RETURN_TO_LAUNCH)


class Axis(NamedTuple):
    """How one of x and y becomes an int: times ten to the power of ``digits``."""

    name: str
    limit: int
    digits: int


LATITUDE, LONGITUDE = Axis("latitude", 90, 7), Axis("longitude", 180, 7)
PLAIN = Axis("param 5", 2**31 - 1, 0), Axis("param 6", 2**31 - 1, 0)
LOCAL = Axis("x", 214_748, 4), Axis("y", 214_748, 4)  # m, as far as an int32 reaches
GLOBAL_FRAMES = (
    MavFrame.GLOBAL,
    MavFrame.GLOBAL_RELATIVE_ALT,
    MavFrame.GLOBAL_INT,
    MavFrame.GLOBAL_RELATIVE_ALT_INT,
    MavFrame.GLOBAL_TERRAIN_ALT,
    MavFrame.GLOBAL_TERRAIN_ALT_INT,
)
AXES: dict[int, tuple[Axis, Axis]] = {
    **dict.fromkeys(MavFrame, LOCAL),
    **dict.fromkeys(GLOBAL_FRAMES, (LATITUDE, LONGITUDE)),
    MavFrame.MISSION: PLAIN,
}


class Entry(NamedTuple):
    """An item as the file has it; ``known_as`` is what a DO_JUMP of the file calls it by."""

    where: str
    known_as: int | None
    item: PlanItem


def item(
    where: str, frame: float, command: float, *, params: Sequence[object], autocontinue: bool
) -> PlanItem:
    """Return an item of checked fields; ``params`` are seven, in degrees and m as in files."""
    p1, p2, p3, p4, x, y, z = (number(where, f"param {n}", p) for n, p in enumerate(params, 1))
    command_id = whole(where, "command", command, 65535)
    axes = AXES.get(whole(where, "frame", frame, 255))
    if axes is None:
        raise PlanFileError(f"{where}: frame {shown(frame)} is unknown")
    if command_id in PLACED and (axes is PLAIN or math.isnan(x) or math.isnan(y)):
        raise PlanFileError(f"{where}: command {command_id} needs a place, but has none")
    x, y = scaled(where, x, axes[0]), scaled(where, y, axes[1])
    return PlanItem(command_id, int(frame), (p1, p2, p3, p4), x, y, z, autocontinue)


def point(where: str, value: object, size: int) -> GeoPoint:
    """Return a place from [latitude, longitude] (``size`` 2) or [latitude, longitude, altitude]."""
    numbers = typed(where, "a point", value, list)
    if len(numbers) != size:
        raise PlanFileError(f"{where}: a point needs {size} numbers, not {len(numbers)}")
    latitude = typed(where, LATITUDE.name, numbers[0], float)
    longitude = typed(where, LONGITUDE.name, numbers[1], float)
    altitude = number(where, "altitude", numbers[2]) if size == 3 else 0.0
    return GeoPoint(
        scaled(where, latitude, LATITUDE), scaled(where, longitude, LONGITUDE), altitude
    )


def scaled(where: str, value: float, axis: Axis) -> int:
    """Return ``value`` as the nearest int of its axis, ties to even; 0 for NaN, not given."""
    if math.isnan(value):
        return 0
    if abs(value) > axis.limit:
        raise PlanFileError(
            f"{where}: {axis.name} {shown(value)} not in -{axis.limit}..{axis.limit}"
        )
    return round(Decimal(repr(value)).scaleb(axis.digits))  # as written: a product would round too


def with_targets(entries: Sequence[Entry]) -> tuple[PlanItem, ...]:
    """Return the items, with each DO_JUMP led to an index instead of the file's own number."""
    indices: dict[float, list[int]] = {}
    for index, entry in enumerate(entries):
        if entry.known_as is not None:
            indices.setdefault(entry.known_as, []).append(index)
    return tuple(_with_target(entry, indices) for entry in entries)


def _with_target(entry: Entry, indices: dict[float, list[int]]) -> PlanItem:
    if entry.item.command != MavCmd.DO_JUMP:
        return entry.item
    target, repeat, p3, p4 = entry.item.params
    match indices.get(target, []):
        case [index]:
            return replace(entry.item, params=(float(index), repeat, p3, p4))
        case []:
            raise PlanFileError(f"{entry.where}: jumps to {shown(target)}, which is not an item")
        case _:
            raise PlanFileError(f"{entry.where}: jumps to {shown(target)}, which is several items")
