"""The places that a task drives to, for the map, from its goals, plan or description. Pure.

A place is ``{"north", "east"}`` in metres of the rover's local frame, or ``{"latitude",
"longitude"}`` in degrees.
"""

import re
from collections.abc import Sequence

from mav_tasks.client.wire import Goal
from mav_tasks.engine.services.missions import Item
from mav_tasks.kinds import GlobalPlace, GoTo, LocalPlace
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.plans.values import PlanItem

Place = dict[str, float]

DEGREE, LOCAL_SCALE = 1e7, 1e4
LOCAL = frozenset({MavFrame.LOCAL_NED})
AT_PLACES = frozenset({MavCmd.NAV_WAYPOINT, MavCmd.NAV_LOITER_TIME, MavCmd.NAV_LOITER_UNLIM, 82})

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_LOCAL = re.compile(rf"go to {_NUMBER} m N, {_NUMBER} m E")
_GLOBAL = re.compile(rf"go to {_NUMBER}, {_NUMBER}")


def places_of_goals(goals: Sequence[Goal]) -> list[Place]:
    """Return the places of goals; other goals have none."""
    found: list[Place] = []
    for goal in goals:
        match goal:
            case GoTo(place=LocalPlace(north=north, east=east)):
                found.append({"north": north, "east": east})
            case GoTo(place=GlobalPlace(latitude_degE7=latitude, longitude_degE7=longitude)):
                found.append(on_earth(latitude, longitude))
    return found


def places_of_items(items: Sequence[PlanItem | Item]) -> list[Place]:
    """Return the places of the items of a mission."""
    found: list[Place] = []
    for item in items:
        if item.command not in AT_PLACES or not (item.x or item.y):
            continue
        if item.frame in LOCAL:
            found.append({"north": item.x / LOCAL_SCALE, "east": item.y / LOCAL_SCALE})
        else:
            found.append(on_earth(item.x, item.y))
    return found


def places_of_words(what: str) -> list[Place] | None:
    """Return the place in a task's description; None if it names none."""
    if found := _LOCAL.fullmatch(what):
        return [{"north": float(found[1]), "east": float(found[2])}]
    if found := _GLOBAL.fullmatch(what):
        return [{"latitude": float(found[1]), "longitude": float(found[2])}]
    return None


def on_earth(latitude: int, longitude: int) -> Place:
    """Return a place from MAVLink's integers."""
    return {"latitude": latitude / DEGREE, "longitude": longitude / DEGREE}
