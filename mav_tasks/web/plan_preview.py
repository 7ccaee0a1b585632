"""The path of a mission file for the map, before it is submitted. Pure."""

from itertools import pairwise
from math import cos, hypot, radians
from typing import Any

from mav_tasks.client.fence_form import shapes_of
from mav_tasks.plans import PlanFile
from mav_tasks.web.goal_places import Place, on_earth, places_of_items
from mav_tasks.web.origins import METRES_PER_DEGREE


def preview_of(plan: PlanFile) -> dict[str, Any]:
    """Return the path, fence and rally points of a file, and the path's length in metres."""
    path = places_of_items(plan.items)
    return {
        "items": len(plan.items),
        "path": path,
        "length": _length_of(path),
        "fence": shapes_of(plan),
        "rally": [on_earth(point.latitude_degE7, point.longitude_degE7) for point in plan.rally],
    }


def _length_of(path: list[Place]) -> float | None:
    """Return the length of a path, m; None if it has local and global places."""
    kinds = {frozenset(place) for place in path}
    if len(kinds) > 1:
        return None
    return round(sum(_apart(*pair) for pair in pairwise(path)), 2)


def _apart(one: Place, other: Place) -> float:
    if "north" in one:
        return hypot(one["north"] - other["north"], one["east"] - other["east"])
    middle = (one["latitude"] + other["latitude"]) / 2
    north = (one["latitude"] - other["latitude"]) * METRES_PER_DEGREE
    east = (one["longitude"] - other["longitude"]) * METRES_PER_DEGREE * cos(radians(middle))
    return hypot(north, east)
