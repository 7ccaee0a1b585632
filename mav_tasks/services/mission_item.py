"""One item of a plan as it is on the wire, whichever of the two messages brought it.

MAVLink guide, "Mission Protocol", MISSION_ITEM_INT. An item has no number of its own: that is its
place in the plan.
"""

from collections.abc import Iterable
from math import isnan, nan
from operator import attrgetter
from struct import Struct
from typing import NamedTuple

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavFrame

CAPACITY = 6_000  # items of one plan; to look at more would hold up a setpoint
NOT_GIVEN = 0x7FFFFFFF  # of x and y, which have no NaN
LARGEST = 0x7FFFFFFF
DEGREES_TO_DEGE7 = 1e7
METRES_TO_LOCAL = 1e4
LOCAL_FRAMES = frozenset({MavFrame.LOCAL_NED, MavFrame.LOCAL_ENU})

_WIRE = Struct("<BHBB4fiif")
_LENGTH = 2 * _WIRE.size  # of an item's text


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

    @property
    def params(self) -> tuple[float, float, float, float, float, float, float]:
        """The seven parameters that a command has."""
        return self[4:]


_fields = attrgetter(*Item._fields)


def item_of(message: m.MissionItemInt | m.MissionItem) -> Item | None:
    """Return the item that a message carries; None if its place is beyond all numbers."""
    item = Item(*_fields(message))
    if isinstance(message, m.MissionItemInt):
        return item
    scale = _scale(item.frame)
    x, y = (NOT_GIVEN if isnan(value) else value * scale for value in (message.x, message.y))
    if max(abs(x), abs(y)) > LARGEST:
        return None
    return item._replace(x=round(x), y=round(y))


def message_of(item: Item, seq: int, mission_type: int, *, to: Address) -> m.MissionItemInt:
    return m.MissionItemInt(to.system_id, to.component_id, seq, *item, mission_type)


def float_message_of(item: Item, seq: int, mission_type: int, *, to: Address) -> m.MissionItem:
    """Return the message that carries an item to a client that asks with MISSION_REQUEST."""
    scale = _scale(item.frame)
    x, y = (nan if value == NOT_GIVEN else value / scale for value in (item.x, item.y))
    return m.MissionItem(to.system_id, to.component_id, seq, *item[:-3], x, y, item.z, mission_type)


def packed(items: Iterable[Item]) -> str:
    """Return items as a text to be kept; ``unpacked`` gives them back bit by bit."""
    return b"".join(_WIRE.pack(*item) for item in items).hex()


def unpacked(text: str) -> tuple[Item, ...]:
    """Return the items that ``packed`` made a text of."""
    return tuple(Item(*fields) for fields in _WIRE.iter_unpack(bytes.fromhex(text)))


def count_of(text: str) -> int:
    """Return the number of these items, without looking at them."""
    return len(text) // _LENGTH


def item_at(text: str, number: int) -> Item:
    """Return one of these items, without looking at the others."""
    return unpacked(text[_LENGTH * number : _LENGTH * (number + 1)])[0]


def _scale(frame: int) -> float:
    if frame == MavFrame.MISSION:
        return 1.0
    return METRES_TO_LOCAL if frame in LOCAL_FRAMES else DEGREES_TO_DEGE7
