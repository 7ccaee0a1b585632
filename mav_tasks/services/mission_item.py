"""One item of a plan as it is on the wire, whichever of the two messages brought it.

MAVLink guide, "Mission Protocol", MISSION_ITEM_INT. An item has no number of its own: that is its
place in the plan.
"""

from collections.abc import Iterable
from math import isfinite, isnan, nan
from struct import Struct
from typing import NamedTuple

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavFrame

NOT_GIVEN = 0x7FFFFFFF  # of x and y, which have no NaN
LARGEST = 0x7FFFFFFF
DEGREES_TO_DEGE7 = 1e7
METRES_TO_LOCAL = 1e4
LOCAL_FRAMES = frozenset({MavFrame.LOCAL_NED, MavFrame.LOCAL_ENU})

_WIRE = Struct("<BHBB4fiif")


class Item(NamedTuple):
    """The fields of MISSION_ITEM_INT, in their order, but for addresses and numbers."""

    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


def item_of(message: m.MissionItemInt | m.MissionItem) -> Item | None:
    """Return the item that a message carries; None if its place is beyond all numbers."""
    if isinstance(message, m.MissionItem):
        scale = _scale(message.frame)
        x, y = _whole(message.x, scale), _whole(message.y, scale)
        if x is None or y is None:
            return None
    else:
        x, y = message.x, message.y
    return Item(
        message.frame,
        message.command,
        message.current,
        message.autocontinue,
        message.param1,
        message.param2,
        message.param3,
        message.param4,
        x,
        y,
        message.z,
    )


def message_of(item: Item, seq: int, mission_type: int, *, to: Address) -> m.MissionItemInt:
    return m.MissionItemInt(to.system_id, to.component_id, seq, *item, mission_type)


def float_message_of(item: Item, seq: int, mission_type: int, *, to: Address) -> m.MissionItem:
    """Return the message that carries an item to a client that asks with MISSION_REQUEST."""
    scale = _scale(item.frame)
    x = nan if item.x == NOT_GIVEN else item.x / scale
    y = nan if item.y == NOT_GIVEN else item.y / scale
    return m.MissionItem(to.system_id, to.component_id, seq, *item[:-3], x, y, item.z, mission_type)


def packed(items: Iterable[Item]) -> str:
    """Return items as a text to be kept; ``unpacked`` gives them back bit by bit."""
    return b"".join(_WIRE.pack(*item) for item in items).hex()


def unpacked(text: str) -> tuple[Item, ...]:
    """Return the items that ``packed`` made a text of."""
    return tuple(Item(*fields) for fields in _WIRE.iter_unpack(bytes.fromhex(text)))


def item_at(text: str, number: int) -> Item:
    """Return one of these items, without looking at the others."""
    start = 2 * _WIRE.size * number
    return Item(*_WIRE.unpack(bytes.fromhex(text[start : start + 2 * _WIRE.size])))


def _scale(frame: int) -> float:
    if frame == MavFrame.MISSION:
        return 1.0
    return METRES_TO_LOCAL if frame in LOCAL_FRAMES else DEGREES_TO_DEGE7


def _whole(value: float, scale: float) -> int | None:
    if isnan(value):
        return NOT_GIVEN
    scaled = value * scale
    return round(scaled) if isfinite(scaled) and abs(scaled) <= LARGEST else None
