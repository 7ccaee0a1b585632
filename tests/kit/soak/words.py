"""What clients say, by what it does to a rover, and when each word was said first.

A word that is repeated by its sender, or that the net delivers once more, stays the word that it
was: it counts from when it was first sent.
"""

from collections import deque
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

from pymavlink.dialects.v20 import common

from tests.kit.client import (
    ARM,
    DRIVE,
    MOVE,
    PAUSE_CONTINUE,
    ROTATE,
    SET_MODE,
    STOP,
    FakeClient,
    Message,
)
from tests.kit.observer import Ways

CANCEL, RELEASE, MISSION_START, REPOSITION = 54010, 54013, 300, 192
NO_PLACE = 0x7FFFFFFF
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
MOTION = {
    "MANUAL_CONTROL": "sticks",
    "RC_CHANNELS_OVERRIDE": "sticks",
    "SET_POSITION_TARGET_LOCAL_NED": "setpoint",
    "SET_POSITION_TARGET_GLOBAL_INT": "setpoint",
}
REMEMBERED = 4_000  # words; of each some dozens of bytes
RECENT = 400  # that may be delivered once more


class Kind(Enum):
    """What a word does to a rover."""

    HALT = auto()
    GO = auto()
    MOTION = auto()
    WISH = auto()  # moves nothing by itself
    OTHER = auto()


#: commands that mean the same whatever their parameters are
PLAIN = {
    STOP: (Kind.HALT, "STOP"),
    CANCEL: (Kind.HALT, "cancel"),
    RELEASE: (Kind.GO, "release"),
    MISSION_START: (Kind.GO, "mission start"),
    MOVE: (Kind.WISH, "submission"),
    ROTATE: (Kind.WISH, "submission"),
    DRIVE: (Kind.WISH, "submission"),
}


@dataclass(frozen=True, slots=True)
class Word:
    """A packet of a client as it reaches the server."""

    kind: Kind
    name: str
    command: int  # 0: it is no command, and nobody answers
    system_id: int  # for whom; 0: for everybody
    param1: float
    peer: str
    first_sent: float
    order: int  # of all that its sender has said first, in its own order
    is_copy: bool  # delivered once more, by the net or by a repetition of its sender


@dataclass(frozen=True, slots=True)
class First:
    """When something was said first, and as which of all that was said."""

    at: float
    order: int


@dataclass(frozen=True, slots=True)
class Said:
    """What a client has sent, to be sent once more."""

    client: FakeClient
    message: Message
    data: bytes
    first: First
    kind: Kind
    name: str


class WordLog:
    """When each packet was first sent, of all clients."""

    def __init__(self, ways: Ways) -> None:
        self._ways = ways
        self._decoder = common.MAVLink(None)
        self._first: dict[tuple[str, bytes], First] = {}
        self._of_message: dict[int, tuple[Message, First]] = {}  # kept, so that no id comes back
        self._order = 0
        self._arrived: dict[tuple[str, bytes], None] = {}
        self.recent: deque[Said] = deque(maxlen=RECENT)

    def __repr__(self) -> str:
        return f"WordLog({len(self._first)} words)"

    def said(self, client: FakeClient, message: Message, data: bytes, *, now: float) -> None:
        """Note what a client sends by itself; the same message again is a repetition.

        Not so of a stream of setpoints or sticks: each of them is said anew.
        """
        self._order += 1
        new = First(now, self._order)
        kind, name, _, _ = self._meaning(message)
        if kind is Kind.MOTION:
            first = new
        else:
            _, first = self._of_message.setdefault(id(message), (message, new))
        self.note(client, data, first=first)
        self._arrived.pop((client.name, data), None)  # its numbers have begun anew
        if kind is not Kind.OTHER and name != "upload":
            self.recent.append(Said(client, message, data, first, kind, name))
        while len(self._of_message) > REMEMBERED:
            del self._of_message[next(iter(self._of_message))]

    def note(self, client: FakeClient, data: bytes, *, first: First) -> None:
        """Note a packet whose word was first sent then."""
        self._first[client.name, data] = first
        while len(self._first) > REMEMBERED:
            del self._first[next(iter(self._first))]

    def word(self, peer: str, data: bytes) -> Word | None:
        """Return what reaches the server; None if it is no word of a known client."""
        first = self._first.get((peer, data))
        if first is None:
            return None
        is_copy = (peer, data) in self._arrived
        self._arrived[peer, data] = None
        while len(self._arrived) > REMEMBERED:
            del self._arrived[next(iter(self._arrived))]
        message = self._decoder.decode(bytearray(data))
        kind, name, command, param1 = self._meaning(message)
        is_copy |= bool(getattr(message, "confirmation", 0))
        target = int(getattr(message, "target_system", getattr(message, "target", 0)))
        return Word(kind, name, command, target, param1, peer, first.at, first.order, is_copy)

    def _meaning(self, message: Any) -> tuple[Kind, str, int, float]:
        kind = message.get_type()
        if kind in MOTION:
            return Kind.MOTION, MOTION[kind], 0, 0.0
        if kind == "SET_MODE":
            is_hold = int(message.custom_mode) == self._ways.hold
            return (Kind.OTHER, "HOLD", 0, 0.0) if is_hold else (Kind.GO, "mode", 0, 0.0)
        if kind == "MISSION_COUNT":
            return Kind.WISH, "upload", 0, 0.0
        if kind not in COMMANDS:
            return Kind.OTHER, kind, 0, 0.0
        command, param1 = int(message.command), float(message.param1)
        what, name = self._of_command(command, param1, message)
        return what, name, command, param1

    def _of_command(self, command: int, param1: float, message: Any) -> tuple[Kind, str]:
        if command == PAUSE_CONTINUE:
            return (Kind.GO, "continue") if param1 == 1.0 else (Kind.HALT, "pause")
        if command == SET_MODE:
            is_hold = self._ways.mode_of(message) == self._ways.hold
            return (Kind.HALT, "HOLD") if is_hold else (Kind.GO, "mode")
        if command == ARM:
            return (Kind.GO, "arm") if param1 else (Kind.HALT, "disarm")
        if command == REPOSITION:
            stays = (getattr(message, "x", 0), getattr(message, "y", 0)) == (NO_PLACE, NO_PLACE)
            return (Kind.OTHER, "stay") if stays else (Kind.GO, "go-to")
        return PLAIN.get(command, (Kind.OTHER, f"command {command}"))
