"""One of a vehicle's three plans (mission, fence or rally points): upload and download."""

from collections.abc import Callable, Sequence
from math import nan
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.timers import Timer
from tests.kit.qgc.vehicle import APM
from tests.kit.qgc.wire import Message

MISSION, FENCE, RALLY = 0, 1, 2
NAMES = {MISSION: "Mission", FENCE: "GeoFence", RALLY: "Rally Point"}
ANSWER_WAIT, TRIES = 1.5, 7  # s [3.1], [11.1]
ITEM_WAIT, ITEM_TRIES = 0.25, 7  # s [3.2]

ACCEPTED, INVALID_SEQUENCE = 0, 13
#: MAV_MISSION_RESULT [3.1], [11.8]
WORDS = {
    1: "Error",
    2: "Coordinate frame is not supported",
    3: "Command is not supported",
    4: "Mission item exceeds storage space",
    5: "One of the parameters has an invalid value",
    **{5 + n: f"Param {n} is invalid value" for n in range(1, 8)},
    13: "Mission item received out of sequence",
    14: "Not accepting any mission commands",
}


class Item(NamedTuple):
    """One item of a plan; places in degE7."""

    command: int
    x: int = 0
    y: int = 0
    z: float = 0.0
    frame: int = 3  # GLOBAL_RELATIVE_ALT
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = nan
    current: int = 0

    @property
    def key(self) -> tuple[int, int, int, int]:
        """The fields that a download must return unchanged: command, frame and place."""
        return self.command, self.frame, self.x, self.y


class PlanManager:
    """Transfers of one plan type; one at a time."""

    def __init__(self, core: Core, kind: int, firmware: str) -> None:
        self._core = core
        self._kind = kind
        self._firmware = firmware
        self._state = "idle"
        self._timer: Timer | None = None
        self._tries = 0
        self._items: Sequence[Item] = ()
        self._asked: set[int] = set()
        self._last_asked: int | None = None
        self._count = 0
        self._read: dict[int, Item] = {}
        self._done: Callable[[bool], None] = lambda _: None
        #: the plan as last read or written; None if never
        self.known: tuple[Item, ...] | None = None

    def read(self, done: Callable[[bool], None]) -> None:
        """Download the plan [3.2]."""
        self._begin("list", done)
        self._send_list()

    def write(self, items: Sequence[Item], done: Callable[[bool], None]) -> None:
        """Upload the plan, even an empty one [3.1]."""
        self._begin("count", done)
        self._items, self._asked, self._last_asked = items, set(), None
        self._send_count()

    def clear(self, done: Callable[[bool], None]) -> None:
        """Clear the plan [11.8]."""
        self._begin("clear", done)
        self._send_clear()

    def send_guided(self, x: float, y: float, z: float) -> None:
        """ArduPilot's "go to" as a mission item; degrees [2.5], [11.3]."""
        self._begin("guided", lambda _: None)
        self._core.send(
            mavlink.MAVLink_mission_item_message(
                self._core.system, AUTOPILOT, 0, 3, 16, 2, 1, 0, 0, 0, 0, x, y, z, MISSION
            )
        )
        words = "Vehicle did not respond to mission item communication: Guided Mode Item"
        self._wait(ANSWER_WAIT, lambda: self._fail(words))

    def receive(self, name: str, message: Message) -> None:
        """Take a message of the mission protocol; only its type is checked [3.2]."""
        if getattr(message, "mission_type", MISSION) != self._kind:
            return
        if self._state == "idle":
            self._core.violation(f"unasked for: {message}")
        elif name == "MISSION_COUNT" and self._state == "list":
            self._take_count(message.count)
        elif name == "MISSION_ITEM_INT" and self._state == "items":
            self._take_item(message)
        elif name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            if self._state in ("count", "requests", "final"):
                self._take_request(message.seq)
        elif name == "MISSION_ACK":
            self._take_ack(message.type)

    # reading

    def _send_list(self) -> None:
        if self._is_spent("Mission request list failed, maximum retries exceeded."):
            return
        message = mavlink.MAVLink_mission_request_list_message
        self._core.send(message(self._core.system, AUTOPILOT, self._kind))
        self._wait(ANSWER_WAIT, self._send_list)

    def _take_count(self, count: int) -> None:
        self._count, self._read, self._state, self._tries = count, {}, "items", 0
        self._ask_item()

    def _ask_item(self) -> None:
        if len(self._read) == self._count:
            message = mavlink.MAVLink_mission_ack_message
            self._core.send(message(self._core.system, AUTOPILOT, ACCEPTED, self._kind))
            self.known = tuple(self._read[seq] for seq in range(self._count))
            self._end(True)
            return
        if self._is_spent("Mission read failed, maximum retries exceeded.", ITEM_TRIES):
            return
        ask = mavlink.MAVLink_mission_request_int_message
        self._core.send(ask(self._core.system, AUTOPILOT, len(self._read), self._kind))
        self._wait(ITEM_WAIT, self._ask_item)

    def _take_item(self, m: Message) -> None:
        if m.seq != len(self._read):
            return
        params = m.param1, m.param2, m.param3, m.param4
        self._read[m.seq] = Item(m.command, m.x, m.y, m.z, m.frame, *params, m.current)
        self._tries = 0
        self._ask_item()

    # writing

    def _send_count(self) -> None:
        if self._is_spent("Mission write mission count failed, maximum retries exceeded."):
            return
        message = mavlink.MAVLink_mission_count_message
        self._core.send(message(self._core.system, AUTOPILOT, len(self._items), self._kind))
        if not self._items:
            self._state = "final"
            self._wait(ANSWER_WAIT, self._no_final_ack)
        else:
            self._wait(ANSWER_WAIT, self._send_count)

    def _take_request(self, seq: int) -> None:
        if seq >= len(self._items):
            self._fail(
                f"Vehicle requested item outside range, count:request {len(self._items)}:{seq}."
                " Send to Vehicle failed."
            )
            return
        self._asked.add(seq)
        self._last_asked = seq
        item = self._items[seq]
        self._core.send(
            mavlink.MAVLink_mission_item_int_message(
                *(self._core.system, AUTOPILOT, seq, item.frame, item.command, item.current, 1),
                *(item.param1, item.param2, item.param3, item.param4),
                *(item.x, item.y, item.z, self._kind),
            )
        )
        if len(self._asked) == len(self._items):
            self._state = "final"
            self._wait(ANSWER_WAIT, self._no_final_ack)
        else:
            self._state = "requests"
            words = "Vehicle did not request all items from ground station"
            self._wait(ANSWER_WAIT, lambda: self._fail(words))

    def _no_final_ack(self) -> None:
        self._fail("Mission write failed, vehicle failed to send final ack.")

    # clearing

    def _send_clear(self) -> None:
        if self._is_spent("Mission clear all failed, maximum retries exceeded."):
            return
        message = mavlink.MAVLink_mission_clear_all_message
        self._core.send(message(self._core.system, AUTOPILOT, self._kind))
        self._wait(ANSWER_WAIT, self._send_clear)

    # common

    def _take_ack(self, result: int) -> None:
        if result == INVALID_SEQUENCE and self._firmware == APM:
            return  # [3.1]
        if result == ACCEPTED:
            if self._state in ("final", "clear", "guided"):
                if self._state != "guided":
                    self.known = tuple(self._items) if self._state == "final" else ()
                self._end(True)
            else:  # [3.1]: an early one is an error
                missing = len(self._items) - len(self._asked)
                self._fail(
                    "Vehicle did not request all items from ground station,"
                    f" missing count {missing}"
                )
            return
        words = WORDS.get(result, f"Unknown error: {result}")
        if self._last_asked is not None and self._state in ("requests", "final"):
            number = self._items[self._last_asked].command
            words = f"{words}. Item #{self._last_asked} Command: {number}"
        self._fail(words)

    def _begin(self, state: str, done: Callable[[bool], None]) -> None:
        assert self._state == "idle", f"{NAMES[self._kind]} is busy: {self._state}"
        self._state, self._done, self._tries = state, done, 0

    def _is_spent(self, words: str, tries: int = TRIES) -> bool:
        if self._tries >= tries:
            self._fail(words)
            return True
        self._tries += 1
        return False

    def _fail(self, words: str) -> None:
        self._core.popup(f"{NAMES[self._kind]} transfer failed. Error: {words}")
        self._end(False)

    def _end(self, success: bool) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._state = "idle"
        self._done(success)

    def _wait(self, seconds: float, call: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._core.timers.after(seconds, call)
