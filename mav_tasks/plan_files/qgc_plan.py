"""The .plan format (JSON); QGroundControl developer guide, "Plan File Format".

Surveys and corridors carry the items that they come to, and these are read; refused are complex
items that do not. Items are counted from 1 as QGroundControl's map counts them: those inside a
survey count, home does not. ``breachReturn`` and what only the planner needs are not read.
"""

import json
from collections.abc import Iterator
from typing import Any, NoReturn

from mav_tasks.errors import PlanFileError
from mav_tasks.plan_files.entries import Entry, item, point, with_targets
from mav_tasks.plan_files.fields import check_version, get, number, shown, typed, whole
from mav_tasks.plan_files.values import FenceCircle, FencePolygon, GeoPoint, PlanFile

MAX_JUMP_ID = 2**31 - 1


def from_json(text: str) -> PlanFile:
    """Return what a JSON object says; PlanFileError names the part, or the place in the text."""
    try:
        root = json.loads(text, parse_int=float, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        place = f"JSON line {error.lineno} column {error.colno}"
        raise PlanFileError(f"not a plan file: {place}: {error.msg}") from None
    except RecursionError:
        raise PlanFileError("not a plan file: JSON nested too deep") from None
    if (kind := get("file", root, "fileType", str)) != "Plan":
        raise PlanFileError(f'file: fileType is {shown(kind)}, "Plan" is needed')
    check_version("file", root, 1)
    mission = get("file", root, "mission", dict)
    check_version("mission", mission, 2)
    entries: list[Entry] = []
    for value in get("mission", mission, "items", list):
        entries += _entries(value, len(entries) + 1)
    home = mission.get("plannedHomePosition")
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
        raise PlanFileError(f"{where}: complex item {name} does not contain its items")
    # not known to a DO_JUMP: in QGroundControl one leads to the list's own simple items only
    return [
        _simple(f"item {index} (in {name})", part)._replace(known_as=None)
        for index, part in enumerate(inner, first)
    ]


def _simple(where: str, value: object) -> Entry:
    fields = typed(where, "it", value, dict)
    if (kind := get(where, fields, "type", str)) != "SimpleItem":
        raise PlanFileError(f"{where}: type {shown(kind)} is unknown")
    params = get(where, fields, "params", list)
    if len(params) != 7:
        raise PlanFileError(f"{where}: {len(params)} params, expected 7")
    frame, command = (get(where, fields, key, float) for key in ("frame", "command"))
    autocontinue = get(where, fields, "autoContinue", bool)
    jump_id = fields.get("doJumpId")
    return Entry(
        where,
        None if jump_id is None else whole(where, "doJumpId", jump_id, MAX_JUMP_ID),
        item(where, frame, command, params=params, autocontinue=autocontinue),
    )


def _part(root: dict[str, Any], name: str) -> dict[str, Any] | None:
    """The fence or the rally points, None if there is nothing in it.

    Version 1 had other keys, and its points must not be lost unseen; planners left it where empty.
    """
    if root.get(name) is None:
        return None
    part = get("file", root, name, dict)
    if not any(value for key, value in part.items() if key != "version"):
        return None
    check_version(name, part, 2)
    return part


def _fence(root: dict[str, Any]) -> Iterator[FencePolygon | FenceCircle]:
    if (fence := _part(root, "geoFence")) is None:
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
