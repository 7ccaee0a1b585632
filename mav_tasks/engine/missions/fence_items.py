"""Checks fence and rally items, and converts them to fences and places. Pure functions.

MAVLink common.xml, MAV_CMD_NAV_FENCE_*: a polygon's corners are consecutive items, and param1 of
each is their number. A return point is kept for the vehicle and not used here. A circle of radius 0
means "no circle": MAVSDK's programs send it so.
"""

from collections.abc import Sequence

from mav_tasks.engine.commands.goals import GLOBAL_FRAMES, bad
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.services.mission_item import Item
from mav_tasks.tasks.driving.fence import Circle, Fence, Polygon, Zone, check
from mav_tasks.tasks.goal import GlobalPlace
from mav_tasks.tasks.lifecycle import TaskReason

R = TaskReason

MAX_LATITUDE, MAX_LONGITUDE = 900_000_000, 1_800_000_000  # degE7
MAX_RADIUS = 1e6  # m
MAX_GROUP = 255
CORNERS = {
    MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    MavCmd.NAV_FENCE_CIRCLE_INCLUSION: True,
    MavCmd.NAV_FENCE_CIRCLE_EXCLUSION: False,
}


def check_fence_item(item: Item, seq: int, *, count: int) -> None:
    """Raise Rejection if an item of a fence with ``count`` items is bad."""
    if item.command == MavCmd.NAV_FENCE_RETURN_POINT:
        _place(item)
    elif item.command in CORNERS:
        _place(item)
        if not (3 <= item.param1 <= count and item.param1 == int(item.param1)):
            words = (
                f"item {seq + 1}: param1 {item.param1:g} corners: not a whole number in 3..{count}"
            )
            raise bad(words, param=1)
    elif item.command in CIRCLES:
        _place(item)
        if not 0.0 <= item.param1 <= MAX_RADIUS:
            words = f"item {seq + 1}: param1 radius {item.param1:g} m not in 0..{MAX_RADIUS:g}"
            raise bad(words, param=1)
    else:
        raise _unsupported(item, seq, "a fence")
    _group(item, seq)


def check_rally_item(item: Item, seq: int) -> None:
    """Raise Rejection if a rally point is bad."""
    if item.command != MavCmd.NAV_RALLY_POINT:
        raise _unsupported(item, seq, "rally points")
    _place(item)


def fence_of(items: Sequence[Item]) -> Fence:
    """Return the fence of checked items. Raise Rejection if they make no valid fence."""
    zones: list[Zone] = []
    seq = 0
    while seq < len(items):
        item = items[seq]
        if item.command in CORNERS:
            number = int(item.param1)
            corners = items[seq : seq + number]
            if len(corners) < number or any(
                (corner.command, corner.param1) != (item.command, item.param1) for corner in corners
            ):
                words = f"item {seq + 1}: polygon of {number} corners is incomplete or mixed"
                raise Rejection(R.BAD_PARAMETER, words)
            places = tuple(_place(corner) for corner in corners)
            zones.append(Polygon(places, CORNERS[MavCmd(item.command)], _group(item, seq)))
            seq += number
            continue
        if item.command in CIRCLES and not _is_no_circle(item):
            is_inclusion = CIRCLES[MavCmd(item.command)]
            zones.append(Circle(_place(item), item.param1, is_inclusion, _group(item, seq)))
        seq += 1
    fence = Fence(tuple(zones))
    wrong = check(fence)
    if wrong:
        raise Rejection(R.BAD_PARAMETER, wrong)
    return fence


def fence_for_vehicle(items: Sequence[Item]) -> tuple[Item, ...]:
    """Return the fence items to send to a vehicle: autopilots refuse circles of radius 0."""
    return tuple(item for item in items if not _is_no_circle(item))


def rally_of(items: Sequence[Item]) -> tuple[GlobalPlace, ...]:
    return tuple(_place(item) for item in items)


def _is_no_circle(item: Item) -> bool:
    return item.command in CIRCLES and item.param1 == 0.0


def _place(item: Item) -> GlobalPlace:
    if item.frame not in GLOBAL_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {item.frame} is not supported here")
    if abs(item.x) > MAX_LATITUDE:
        raise bad(f"x latitude {item.x / 1e7:.7f} not in -90..90", param=5)
    if abs(item.y) > MAX_LONGITUDE:
        raise bad(f"y longitude {item.y / 1e7:.7f} not in -180..180", param=6)
    return GlobalPlace(item.x, item.y)


def _group(item: Item, seq: int) -> int:
    group = item.param2
    if group != group:  # NaN: not given
        return 0
    if not (0 <= group <= MAX_GROUP and group == int(group)):
        raise bad(f"item {seq + 1}: param2 group {group:g} not in 0..{MAX_GROUP}", param=2)
    return int(group)


def _unsupported(item: Item, seq: int, what: str) -> Rejection:
    words = f"item {seq + 1}: command {item.command} is not supported in {what}"
    return Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
