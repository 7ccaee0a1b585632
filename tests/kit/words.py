"""Clients' requests, classified by their effect on a rover, with the time of their first sending.

A request that its sender repeats, or that the net delivers again, is the same request: its first
sending counts.
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

CANCEL, CLEAR, RELEASE, MISSION_START, REPOSITION = 54010, 54011, 54013, 300, 192
NO_PLACE = 0x7FFFFFFF
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
MOTION = {
    "MANUAL_CONTROL": "sticks",
    "RC_CHANNELS_OVERRIDE": "sticks",
    "SET_POSITION_TARGET_LOCAL_NED": "setpoint",
    "SET_POSITION_TARGET_GLOBAL_INT": "setpoint",
}
REMEMBERED = 4_000  # requests, some dozens of bytes each
RECENT = 400  # requests that may be delivered again


class Kind(Enum):
    """The effect of a request on a rover."""

    HALT = auto()
    GO = auto()
    MOTION = auto()
    WISH = auto()  # moves nothing by itself
    OTHER = auto()


#: commands whose meaning does not depend on parameters
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
    """A client's packet that reaches the server."""

    kind: Kind
    name: str
    command: int  # 0: not a command, not answered
    system_id: int  # target; 0: broadcast
    param1: float
    peer: str
    first_sent: float
    order: int  # rank among first sendings
    is_copy: bool  # a repetition by the net or by its sender


@dataclass(frozen=True, slots=True)
class First:
    """Time and rank of a first sending."""

    at: float
    order: int


@dataclass(frozen=True, slots=True)
class Said:
    """A client's sent request, which can be sent again."""

    client: FakeClient
    message: Message
    data: bytes
    first: First
    kind: Kind
    name: str


class WordLog:
    """Records the first sending of each packet, for all clients."""

    def __init__(self, ways: Ways) -> None:
        self._ways = ways
        self._decoder = common.MAVLink(None)
        self._first: dict[tuple[str, bytes], First] = {}
        self._of_message: dict[int, tuple[Message, First]] = {}  # so that no id() is reused
        self._order = 0
        self._arrived: dict[tuple[str, bytes], None] = {}
        self.recent: deque[Said] = deque(maxlen=RECENT)

    def __repr__(self) -> str:
        return f"WordLog({len(self._first)} words)"

    def said(self, client: FakeClient, message: Message, data: bytes, *, now: float) -> None:
        """Record a client's sending; the same message object again is a repetition.

        Setpoints and stick messages of a stream are each new.
        """
        self._order += 1
        new = First(now, self._order)
        kind, name, _, _ = self._meaning(message)
        if kind is Kind.MOTION:
            first = new
        else:
            _, first = self._of_message.setdefault(id(message), (message, new))
        self.note(client, data, first=first)
        self._arrived.pop((client.name, data), None)  # its sequence numbers have wrapped
        if kind is not Kind.OTHER and name != "upload":
            self.recent.append(Said(client, message, data, first, kind, name))
        while len(self._of_message) > REMEMBERED:
            del self._of_message[next(iter(self._of_message))]

    def note(self, client: FakeClient, data: bytes, *, first: First) -> None:
        """Record a packet with the first sending of its request."""
        self._first[client.name, data] = first
        while len(self._first) > REMEMBERED:
            del self._first[next(iter(self._first))]

    def word(self, peer: str, data: bytes) -> Word | None:
        """Return the request in a packet at the server; None if it is none of a known client."""
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
