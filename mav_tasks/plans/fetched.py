"""Items as a rover gives them back, as the values that a file is written from."""

from collections.abc import Sequence
from dataclasses import replace

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.plans.values import FenceCircle, FencePolygon, GeoPoint, PlanFile, PlanItem

VERTICES = {
    MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {MavCmd.NAV_FENCE_CIRCLE_INCLUSION: True, MavCmd.NAV_FENCE_CIRCLE_EXCLUSION: False}


def mission_of(items: Sequence[PlanItem], *, has_home_item: bool) -> PlanFile:
    """Return a mission; ``has_home_item``: the first item is home, and jumps count it."""
    if not has_home_item or not items:
        return PlanFile(tuple(items), None, (), ())
    first, *others = items
    is_known = (first.x, first.y) != (0, 0)
    home = GeoPoint(first.x, first.y, first.z) if is_known else None
    return PlanFile(tuple(_one_less(item) for item in others), home, (), ())


def fence_of(items: Sequence[PlanItem]) -> PlanFile:
    """Return a fence; PlanFileError if a file cannot hold it. A return point is left out."""
    parts: list[FencePolygon | FenceCircle] = []
    rest = [item for item in items if item.command != MavCmd.NAV_FENCE_RETURN_POINT]
    while rest:
        first = rest[0]
        if first.params[1]:
            raise PlanFileError("the fence has inclusion groups, which a .plan cannot hold")
        size = 1
        if first.command in VERTICES:
            size = max(int(first.params[0]), 1)
            vertices = tuple((item.x, item.y) for item in rest[:size])
            parts.append(FencePolygon(VERTICES[MavCmd(first.command)], vertices))
        elif first.command in CIRCLES:
            inclusion = CIRCLES[MavCmd(first.command)]
            parts.append(FenceCircle(inclusion, (first.x, first.y), first.params[0]))
        else:
            raise PlanFileError(f"the fence has an item {first.command}, which is not a fence item")
        rest = rest[size:]
    return PlanFile((), None, tuple(parts), ())


def _one_less(item: PlanItem) -> PlanItem:
    if item.command != MavCmd.DO_JUMP:
        return item
    target, *others = item.params
    return replace(item, params=(target - 1, others[0], others[1], others[2]))
