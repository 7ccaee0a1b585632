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
#: whether a zone is an inclusion, by command
CORNERS: dict[int, bool] = {
    MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES: dict[int, bool] = {
    MavCmd.NAV_FENCE_CIRCLE_INCLUSION: True,
    MavCmd.NAV_FENCE_CIRCLE_EXCLUSION: False,
}
OF_FENCE = (*CORNERS, *CIRCLES, MavCmd.NAV_FENCE_RETURN_POINT)


def check_fence_item(item: Item, seq: int, *, count: int) -> None:
    """Raise Rejection if an item of a fence with ``count`` items is bad."""
    name, value = f"item {seq + 1}", item.param1
    _check_command(item, name, OF_FENCE, "a fence")
    _place(item)
    if item.command in CORNERS and not (3 <= value <= count and value == int(value)):
        words = f"{name}: param1 {value:g} corners: not a whole number in 3..{count}"
        raise bad(words, param=1)
    if item.command in CIRCLES and not 0.0 <= value <= MAX_RADIUS:
        raise bad(f"{name}: param1 radius {value:g} m not in 0..{MAX_RADIUS:g}", param=1)
    group = item.param2
    if group == group and not (0 <= group <= MAX_GROUP and group == int(group)):
        raise bad(f"{name}: param2 group {group:g} not in 0..{MAX_GROUP}", param=2)


def check_rally_item(item: Item, seq: int) -> None:
    """Raise Rejection if a rally point is bad."""
    _check_command(item, f"item {seq + 1}", (MavCmd.NAV_RALLY_POINT,), "rally points")
    _place(item)


def fence_of(items: Sequence[Item]) -> Fence:
    """Return the fence of checked items. Raise Rejection if they make no valid fence."""
    zones: list[Zone] = []
    seq = 0
    while seq < len(items):
        item, number = items[seq], 1
        code, size = item.command, item.param1
        group = 0 if item.param2 != item.param2 else int(item.param2)  # NaN: not given
        if code in CORNERS:
            number = int(size)
            corners = items[seq : seq + number]
            if [(each.command, each.param1) for each in corners] != [(code, size)] * number:
                words = f"item {seq + 1}: polygon of {number} corners is incomplete or mixed"
                raise Rejection(R.BAD_PARAMETER, words)
            zones.append(Polygon(tuple(map(_place, corners)), CORNERS[code], group))
        elif code in CIRCLES and not _is_no_circle(item):
            zones.append(Circle(_place(item), size, CIRCLES[code], group))
        seq += number
    fence = Fence(tuple(zones))
    wrong = check(fence)
    if wrong:
        raise Rejection(R.BAD_PARAMETER, wrong)
    return fence


def fence_for_vehicle(items: Sequence[Item]) -> tuple[Item, ...]:
    """Return the fence items to send to a vehicle: autopilots refuse circles of radius 0."""
    return tuple(item for item in items if not _is_no_circle(item))


def rally_of(items: Sequence[Item]) -> tuple[GlobalPlace, ...]:
    return tuple(map(_place, items))


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


def _check_command(item: Item, name: str, commands: Sequence[int], what: str) -> None:
    if item.command not in commands:
        words = f"{name}: command {item.command} is not supported in {what}"
        raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
