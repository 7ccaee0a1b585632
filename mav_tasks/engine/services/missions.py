"""Plans on the wire: one item, whichever of the two messages brought it; and sending a plan.

MAVLink guide, "Mission Protocol", MISSION_ITEM_INT: an item has no number of its own, that is its
place in the plan. "Upload a Mission to the Vehicle": we are the ground station's end. One plan at a
time; what the vehicle asks for decides what is sent, whichever of the two requests it asks with.
"""

from collections import deque
from collections.abc import Callable, Iterable
from math import inf, isnan, nan
from operator import attrgetter
from struct import Struct
from typing import NamedTuple, Protocol

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavFrame, MavMissionResult

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


class Patience(NamedTuple):
    """How long an upload goes on; seconds."""

    count_again: float  # until the other end asks for something
    give_up: float  # without a request
    at_most: float  # in all
    #: without an answer to the last item, after which it is sent once more; inf: never
    last_again: float = inf


#: ArduPilot asks again after 1.0 s; MAVSDK waits 2.5 s for our own answer
TO_VEHICLE = Patience(count_again=0.25, give_up=1.2, at_most=2.0)


class Done(Protocol):
    """What is done when it is known what became of an upload.

    ``result`` None: the other end was silent. ``opaque_id`` is its id of the plan, 0 for none.
    """

    def __call__(self, result: MavMissionResult | None, *, opaque_id: int, now: float) -> None: ...


class MissionUploader:
    """The plans on their way to one vehicle."""

    def __init__(
        self,
        target: Address,
        *,
        patience: Patience = TO_VEHICLE,
        fits: Callable[[int], bool] = lambda _opaque_id: True,
    ) -> None:
        """``fits`` says of an id in an accepting ack whether it can be this plan's."""
        self._target = target
        self._patience = patience
        self._fits = fits
        self._waiting: deque[tuple[int, tuple[Item, ...], Done]] = deque()
        self._outgoing: list[m.Message] = []
        # of the first one:
        self.again_at = inf  #: s, when the count, or the last item, is sent again
        self.give_up_at = inf  #: s, when it has failed
        self._over_at = inf
        self._is_asked = False
        self._is_sent = False  # whole: its last item has been asked for and sent

    def __repr__(self) -> str:
        return f"MissionUploader({len(self._waiting)} to do)"

    def begin(self, mission_type: int, items: tuple[Item, ...], done: Done, *, now: float) -> None:
        """Send a plan, after those that are under way; ``done`` is called once."""
        self._waiting.append((mission_type, items, done))
        if len(self._waiting) == 1:
            self._start(now=now)

    def receive(self, message: m.Message, *, now: float) -> None:
        """Take in what the vehicle says of an upload."""
        mission_type, items, _ = self._waiting[0] if self._waiting else (None, (), None)
        if getattr(message, "mission_type", None) != mission_type:
            return
        match message:
            case m.MissionRequest() | m.MissionRequestInt() if message.seq < len(items):
                self._is_asked = True
                self.give_up_at = min(now + self._patience.give_up, self._over_at)
                self._send(message.seq, now=now)
            case m.MissionAck():
                # one of an earlier upload may come late
                is_answer = (self._is_sent or not items) and self._fits(message.opaque_id)
                if is_answer or message.type != MavMissionResult.ACCEPTED:
                    known = (result for result in MavMissionResult if result == message.type)
                    result = next(known, MavMissionResult.ERROR)
                    self._end(result, opaque_id=message.opaque_id, now=now)

    def handle_deadline(self, *, now: float) -> None:
        """Offer it again, and give up in the end."""
        if now >= self.give_up_at:
            self._end(None, opaque_id=0, now=now)
        elif now >= self.again_at and self._is_asked:
            self._send(-1, now=now)
        elif now >= self.again_at:
            self._offer(now=now)

    def take(self) -> list[m.Message]:
        """Return what is to be sent since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def _start(self, *, now: float) -> None:
        self.give_up_at = now + self._patience.give_up
        self._over_at = now + self._patience.at_most
        self._is_asked = self._is_sent = False
        self._offer(now=now)

    def _offer(self, *, now: float) -> None:
        mission_type, items, _ = self._waiting[0]
        self.again_at = now + self._patience.count_again
        self._outgoing.append(m.MissionCount(*self._target, len(items), mission_type))

    def _send(self, seq: int, *, now: float) -> None:
        """Send an item; -1: the last one."""
        mission_type, items, _ = self._waiting[0]
        seq %= len(items)
        self.again_at = inf
        if seq == len(items) - 1:
            self._is_sent, self.again_at = True, now + self._patience.last_again
        self._outgoing.append(message_of(items[seq], seq, mission_type, to=self._target))

    def _end(self, result: MavMissionResult | None, *, opaque_id: int, now: float) -> None:
        _, _, done = self._waiting.popleft()
        self.again_at = self.give_up_at = inf
        if self._waiting:
            self._start(now=now)
        done(result, opaque_id=opaque_id, now=now)
