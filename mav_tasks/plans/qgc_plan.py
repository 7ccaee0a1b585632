"""QGroundControl's formats in JSON: .plan, and the older .mission, .fence and .rally.

QGroundControl developer guide, "Plan File Format"; older ones have no page any more. Surveys and
corridors carry the items that they come to, and these are read; refused are complex items that do
not. Items are counted from 1 as QGroundControl's map counts them: those inside a survey count, home
does not. ``breachReturn`` and what only the planner needs are not read.
"""

import json
from collections.abc import Iterator
from typing import Any, NoReturn

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.plans.entries import Entry, item, point, with_targets
from mav_tasks.plans.fields import check_version, get, number, shown, typed, whole
from mav_tasks.plans.values import FenceCircle, FencePolygon, GeoPoint, PlanFile

MAX_JUMP_ID = 2**31 - 1
WITHOUT_ITEMS = (
    "does not contain its items: if a newer QGroundControl does not save it with them, upload it"
    " from there to a rover, download it, and save it again"
)


def from_json(text: str) -> PlanFile:
    """Return what a JSON object says; PlanFileError names the part, or the place in the text."""
    try:
        root = json.loads(text, parse_int=float, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        place = f"JSON line {error.lineno} column {error.colno}"
        raise PlanFileError(f"not a plan file: {place}: {error.msg}") from None
    except RecursionError:
        raise PlanFileError("not a plan file: JSON nested too deep") from None
    # the first version had no fileType
    match kind := get("file", {"fileType": "Mission"} | root, "fileType", str):
        case "Plan":
            check_version("file", root, 1)
            mission = get("file", root, "mission", dict)
            check_version("mission", mission, 2)
            return _mission(mission, root)
        case "Mission":
            check_version("file", root, "1.0", 1, 2)
            return _mission(get("file", {"mission": root} | root, "mission", dict), root)
        case "GeoFence":
            return _mission({"items": []}, {"geoFence": root})
        case "RallyPoints":
            return _mission({"items": []}, {"rallyPoints": root})
    words = "is neither Plan nor Mission, GeoFence or RallyPoints"
    raise PlanFileError(f"file: fileType {shown(kind)} {words}")


def _mission(mission: dict[str, Any], root: dict[str, Any]) -> PlanFile:
    """Return a mission, with the fence and the rally points of a root."""
    if mission.get("complexItems"):
        raise PlanFileError(f"complexItems: a survey {WITHOUT_ITEMS}")
    entries: list[Entry] = []
    for value in get("mission", mission, "items", list):
        entries += _entries(value, len(entries) + 1)
    home = mission.get("plannedHomePosition")
    if isinstance(home, dict):  # once it was an item
        home = get("home", home, "coordinate", list)
    return PlanFile(
        with_targets(entries),
        None if home is None else point("home", home, 3),
        tuple(_fence(root)),
        tuple(_rally(root)),
    )


def _refuse_constant(name: str) -> NoReturn:
    raise PlanFileError(f"not a plan file: {name} is not a JSON number")


def _entries(value: object, first: int) -> list[Entry]:
    """The items that one entry of the list comes to; ``first`` is the number of the first."""
    where = f"item {first}"
    fields = typed(where, "it", value, dict)
    if get(where, fields, "type", str) != "ComplexItem":
        return [_simple(where, fields)]
    name = shown(get(where, fields, "complexItemType", str))
    transects = fields.get("TransectStyleComplexItem")
    inner = transects.get("Items") if isinstance(transects, dict) else None
    if not isinstance(inner, list) or not inner:
        raise PlanFileError(f"{where}: complex item {name} {WITHOUT_ITEMS}")
    # not known to a DO_JUMP: in QGroundControl one leads to the list's own simple items only
    return [
        _simple(f"item {index} (in {name})", part)._replace(known_as=None)
        for index, part in enumerate(inner, first)
    ]


def _simple(where: str, value: object) -> Entry:
    fields = typed(where, "it", value, dict)
    if (kind := get(where, fields, "type", str)) not in ("SimpleItem", "missionItem"):
        raise PlanFileError(f"{where}: type {shown(kind)} is unknown")
    if "param1" in fields:  # version 1
        params = [get(where, fields, f"param{number}", float) for number in range(1, 5)]
    else:
        params = get(where, fields, "params", list)
    if "coordinate" in fields:  # up to 2017
        params = [*params, *get(where, fields, "coordinate", list)]
    if len(params) != 7:
        raise PlanFileError(f"{where}: {len(params)} params, expected 7")
    frame, command = (get(where, fields, key, float) for key in ("frame", "command"))
    autocontinue = get(where, fields, "autoContinue", bool)
    jump_id = fields.get("doJumpId", fields.get("id"))
    return Entry(
        where,
        None if jump_id is None else whole(where, "doJumpId", jump_id, MAX_JUMP_ID),
        item(where, frame, command, params=params, autocontinue=autocontinue),
    )


def _part(root: dict[str, Any], name: str) -> dict[str, Any] | None:
    """The fence or the rally points, None if there is nothing in it."""
    if root.get(name) is None:
        return None
    part = get("file", root, name, dict)
    if not any(value for key, value in part.items() if key != "version"):
        return None
    check_version(name, part, 1, 2)
    return part


def _fence(root: dict[str, Any]) -> Iterator[FencePolygon | FenceCircle]:
    if (fence := _part(root, "geoFence")) is None:
        return
    if fence["version"] == 1:
        if vertices := get("geoFence", fence, "polygon", list):
            yield _polygon("fence", {"version": 1.0, "inclusion": True, "polygon": vertices})
        return
    for index, value in enumerate(get("geoFence", fence, "polygons", list), 1):
        yield _polygon(f"fence polygon {index}", value)
    for index, value in enumerate(get("geoFence", fence, "circles", list), 1):
        yield _circle(f"fence circle {index}", value)


def _polygon(where: str, value: object) -> FencePolygon:
    fields = typed(where, "it", value, dict)
    check_version(where, fields, 1)
    vertices = [point(where, vertex, 2)[:2] for vertex in get(where, fields, "polygon", list)]
    if len(vertices) < 3:
        raise PlanFileError(f"{where}: {len(vertices)} points, at least 3 are needed")
    return FencePolygon(get(where, fields, "inclusion", bool), tuple(vertices))


def _circle(where: str, value: object) -> FenceCircle:
    fields = typed(where, "it", value, dict)
    check_version(where, fields, 1)
    circle = get(where, fields, "circle", dict)
    radius = number(where, "radius", get(where, circle, "radius", float))
    if radius <= 0:
        raise PlanFileError(f"{where}: radius {shown(radius)} m is not above 0")
    center = point(where, get(where, circle, "center", list), 2)[:2]
    return FenceCircle(get(where, fields, "inclusion", bool), center, radius)


def _rally(root: dict[str, Any]) -> Iterator[GeoPoint]:
    if (rally := _part(root, "rallyPoints")) is not None:
        for index, value in enumerate(get("rallyPoints", rally, "points", list), 1):
            yield point(f"rally point {index}", value, 3)
