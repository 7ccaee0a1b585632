"""A mission as a text of either format; what is written reads back as the same items.

Both formats want a home, which not everybody knows: then the first place of the mission is written,
as ground stations do that have none.
"""

import json
from math import isfinite
from pathlib import Path
from typing import Any

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.basics.whole_file import write_whole
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.plans.entries import GLOBAL_FRAMES, LATITUDE, LONGITUDE, PLACED
from mav_tasks.plans.numbers import place, shortest, unscaled
from mav_tasks.plans.values import (
    NO_PARAMS,
    FenceCircle,
    FencePolygon,
    GeoPoint,
    PlanFile,
    PlanItem,
    fence_items,
)

NOWHERE = GeoPoint(0, 0, 0.0)
ANY_FIRMWARE, GROUND_ROVER = 0, 10  # MAV_AUTOPILOT, MAV_TYPE: what the planner offers
WPL_SUFFIXES = (".waypoints", ".wpl", ".txt")


def write_plan(plan: PlanFile, path: Path) -> None:
    """Write a file, as a .plan or, by its name, as QGC WPL 110; PlanFileError if it cannot be."""
    try:
        write_whole(path, format_for(plan, path))
    except OSError as error:
        raise PlanFileError(f"{path}: {error.strerror}") from error


def format_for(plan: PlanFile, path: Path) -> str:
    """Return the text that belongs into a file of this name."""
    if path.suffix.lower() in WPL_SUFFIXES:
        return format_wpl(plan)
    return format_plan(plan)


def format_plan(plan: PlanFile) -> str:
    """Return the text of a .plan file, with fence and rally points."""
    home = home_of(plan)
    root = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "mav-tasks",
        "mission": {
            "version": 2,
            "firmwareType": ANY_FIRMWARE,
            "vehicleType": GROUND_ROVER,
            "globalPlanAltitudeMode": 1,
            "cruiseSpeed": 1,
            "hoverSpeed": 1,
            "plannedHomePosition": [*_degrees(home), shortest(home.altitude)],
            "items": [_simple_item(number, item) for number, item in enumerate(plan.items, 1)],
        },
        "geoFence": {
            "version": 2,
            "polygons": [_polygon(each) for each in plan.fence if isinstance(each, FencePolygon)],
            "circles": [_circle(each) for each in plan.fence if isinstance(each, FenceCircle)],
        },
        "rallyPoints": {
            "version": 2,
            "points": [[*_degrees(each), shortest(each.altitude)] for each in plan.rally],
        },
    }
    return json.dumps(root, indent=4, allow_nan=False) + "\n"


def format_wpl(plan: PlanFile) -> str:
    """Return the text of a QGC WPL 110 file; PlanFileError if there is a fence: it holds none.

    Home is line 0, so that each item, and where a jump leads, counts from 1.
    """
    if fence_items(plan) or plan.rally:
        raise PlanFileError("QGC WPL 110 can hold only a mission: choose a name that ends in .plan")
    first = PlanItem(MavCmd.NAV_WAYPOINT, MavFrame.GLOBAL, NO_PARAMS, *home_of(plan), True)
    lines = [_line(number, item) for number, item in enumerate((first, *plan.items))]
    return "\n".join(["QGC WPL 110", *lines]) + "\n"


def home_of(plan: PlanFile) -> GeoPoint:
    """Return the home to write: the plan's own, else its first place on earth, else 0, 0."""
    if plan.home is not None:
        return plan.home
    for item in plan.items:
        if item.command in PLACED and item.frame in GLOBAL_FRAMES:
            return GeoPoint(item.x, item.y, 0.0)
    return NOWHERE


def _simple_item(number: int, item: PlanItem) -> dict[str, Any]:
    params = (*_params(item), *place(item.frame, item.x, item.y), shortest(item.z))
    return {
        "type": "SimpleItem",
        "autoContinue": item.autocontinue,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [value if isfinite(value) else None for value in params],
    }


def _line(number: int, item: PlanItem) -> str:
    x, y = place(item.frame, item.x, item.y)
    numbers = (*_params(item), x, y, shortest(item.z))
    is_current = number == 0
    head = (number, int(is_current), item.frame, item.command)
    return "\t".join([*map(str, head), *map(repr, numbers), str(int(item.autocontinue))])


def _params(item: PlanItem) -> tuple[float, ...]:
    """Return the parameters; a jump leads to a number that counts from 1."""
    first, *others = item.params
    if item.command == MavCmd.DO_JUMP:
        first += 1
    return tuple(shortest(value) for value in (first, *others))


def _polygon(fence: FencePolygon) -> dict[str, Any]:
    points = [_degrees(GeoPoint(*vertex, 0.0)) for vertex in fence.vertices]
    return {"version": 1, "inclusion": fence.inclusion, "polygon": points}


def _circle(fence: FenceCircle) -> dict[str, Any]:
    center = _degrees(GeoPoint(*fence.center, 0.0))
    circle = {"center": center, "radius": shortest(fence.radius)}
    return {"version": 1, "inclusion": fence.inclusion, "circle": circle}


def _degrees(point: GeoPoint) -> list[float]:
    return [unscaled(point.latitude_degE7, LATITUDE), unscaled(point.longitude_degE7, LONGITUDE)]
