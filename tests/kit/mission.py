"""A client's side of the mission protocol, as in MAVSDK 4.1: retries, time-outs, reactions.

Plan ids, which pymavlink's definitions lack, are decoded manually.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

from pymavlink.dialects.v20 import common

from tests.kit.client import Received

if TYPE_CHECKING:
    from tests.kit.client import FakeClient

COUNT, ITEM_INT, REQUEST, REQUEST_INT, MISSION_ACK, CURRENT, REACHED = 44, 73, 40, 51, 47, 42, 46
ARDUPILOTMEGA = 3  # MAV_AUTOPILOT
RETRY = 0.5  # s
TRIES = 5  # of an upload: sends of a message plus waits for the next request
TIMEOUT = -1  # instead of a MAV_MISSION_RESULT


class Item(NamedTuple):
    """One mission item; places in degE7."""

    command: int
    x: int = 0
    y: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = nan
    z: float = 0.0
    frame: int = 3
    current: int = 0
    autocontinue: int = 1

    def message(self, seq: int, kind: int, target: tuple[int, int]) -> Any:
        return common.MAVLink_mission_item_int_message(
            *target,
            seq,
            self.frame,
            self.command,
            self.current,
            self.autocontinue,
            self.param1,
            self.param2,
            self.param3,
            self.param4,
            self.x,
            self.y,
            self.z,
            kind,
        )


class Current(NamedTuple):
    """MISSION_CURRENT."""

    seq: int
    total: int
    state: int
    mode: int
    mission_id: int
    fence_id: int
    rally_id: int

    @classmethod
    def of(cls, payload: bytes) -> Current:
        return cls(*struct.unpack("<HHBBIII", payload.ljust(18, b"\0")[:18]))


class Ack(NamedTuple):
    """MISSION_ACK."""

    target_system: int
    target_component: int
    result: int
    kind: int
    opaque_id: int

    @classmethod
    def of(cls, payload: bytes) -> Ack:
        return cls(*struct.unpack("<BBBBI", payload.ljust(8, b"\0")[:8]))


class Count(NamedTuple):
    """MISSION_COUNT."""

    items: int
    target_system: int
    target_component: int
    kind: int
    opaque_id: int

    @classmethod
    def of(cls, payload: bytes) -> Count:
        return cls(*struct.unpack("<HBBBI", payload.ljust(9, b"\0")[:9]))


@dataclass
class Upload:
    """One upload; ``result`` is a MAV_MISSION_RESULT, TIMEOUT, or None while it is active."""

    client: FakeClient
    items: Sequence[Item]
    kind: int = 0
    target: tuple[int, int] = (1, 1)
    result: int | None = None
    opaque_id: int = 0
    requests: list[int] = field(default_factory=list)
    #: requests beyond the next item: MAVSDK only warns, but stops sending its count
    ahead: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._tries = 0
        self._is_asked = False
        self._next = 0
        self._next_at = self.client.net.now
        self.client.roles.append(self)
        self.turn(now=self._next_at)

    def next_deadline(self) -> float | None:
        return None if self.result is not None else self._next_at

    def turn(self, *, now: float) -> None:
        if self.result is not None or now < self._next_at:
            return
        if self._tries >= TRIES:
            self._end(TIMEOUT)
            return
        self._tries += 1
        self._next_at = now + RETRY
        if not self._is_asked:
            message = common.MAVLink_mission_count_message(*self.target, len(self.items), self.kind)
            self.client.send(message)

    def take(self, packet: Received, *, now: float) -> None:
        if self.result is not None or packet.source != self.target:
            return
        if packet.message_id == REQUEST and not self._is_ardupilot:
            self.client.send(common.MAVLink_mission_ack_message(*self.target, 3, self.kind))
            self._end(3)  # like MAVSDK, which accepts it from ArduPilot only
        elif packet.message_id in (REQUEST, REQUEST_INT):
            seq, _, _, kind = struct.unpack("<HBBB", packet.payload.ljust(5, b"\0")[:5])
            if kind == self.kind:
                self._take_request(seq, now=now)
        elif packet.message_id == MISSION_ACK:
            ack = Ack.of(packet.payload)
            if ack.kind != self.kind:
                self._end(1)  # MAVSDK aborts
                return
            is_early = ack.result == 0 and self._next != len(self.items)
            self.opaque_id = ack.opaque_id
            self._end(1 if is_early else ack.result)

    @property
    def _is_ardupilot(self) -> bool:
        """Whether the autopilot's last heartbeat shows ArduPilot."""
        beats = [p for p in self.client.of_id(0) if p.source == (self.target[0], 1)]
        return bool(beats) and self.client.decoded(beats[-1]).autopilot == ARDUPILOTMEGA

    def cancel(self) -> None:
        """Cancel the upload with a MISSION_ACK."""
        self.client.send(common.MAVLink_mission_ack_message(*self.target, 15, self.kind))
        self._end(15)

    def _take_request(self, seq: int, *, now: float) -> None:
        self._is_asked = True
        self.requests.append(seq)
        if seq > self._next:
            self.ahead.append(seq)
            return
        if seq < self._next and self._tries >= TRIES:
            self._end(TIMEOUT)
            return
        self._tries = 1 if seq == self._next else self._tries + 1
        self._next_at = now + RETRY
        if seq < len(self.items):
            self._next = seq + 1
            self.client.send(self.items[seq].message(seq, self.kind, self.target))

    def _end(self, result: int) -> None:
        self.result = result
        self.client.roles.remove(self)


@dataclass
class Download:
    """One download; ``items`` are the messages in order, once ``is_done``."""

    client: FakeClient
    kind: int = 0
    target: tuple[int, int] = (1, 1)
    count: int | None = None
    opaque_id: int = 0
    items: list[Any] = field(default_factory=list)
    is_done: bool = False
    has_failed: bool = False

    def __post_init__(self) -> None:
        self._tries = 0
        self._next_at = self.client.net.now
        self.client.roles.append(self)
        self.turn(now=self.client.net.now)

    def next_deadline(self) -> float | None:
        return None if self.is_done or self.has_failed else self._next_at

    def turn(self, *, now: float) -> None:
        if self.is_done or self.has_failed or now < self._next_at:
            return
        if self._tries >= TRIES:
            self.has_failed = True
            self.client.roles.remove(self)
            return
        self._tries += 1
        self._next_at = now + RETRY
        if self.count is None:
            self.client.send(common.MAVLink_mission_request_list_message(*self.target, self.kind))
        else:
            message = common.MAVLink_mission_request_int_message(
                *self.target, len(self.items), self.kind
            )
            self.client.send(message)

    def take(self, packet: Received, *, now: float) -> None:
        if packet.source != self.target or self.is_done or self.has_failed:
            return
        if packet.message_id == COUNT and self.count is None:
            count = Count.of(packet.payload)
            if count.kind != self.kind:
                return
            self.count, self.opaque_id = count.items, count.opaque_id
        elif packet.message_id == ITEM_INT and self.count is not None:
            item = self.client.decoded(packet)
            if item.seq != len(self.items) or item.mission_type != self.kind:
                return
            self.items.append(item)
        else:
            return
        self._tries = 0
        self._next_at = now
        if len(self.items) == self.count:
            self.is_done = True
            self.client.roles.remove(self)
            self.client.send(common.MAVLink_mission_ack_message(*self.target, 0, self.kind))
        else:
            self.turn(now=now)


def currents(client: FakeClient) -> list[Current]:
    """Return the received MISSION_CURRENTs."""
    return [Current.of(packet.payload) for packet in client.of_id(CURRENT)]


def reached(client: FakeClient) -> list[int]:
    """Return the items of MISSION_ITEM_REACHED, in order."""
    return [struct.unpack("<H", p.payload.ljust(2, b"\0"))[0] for p in client.of_id(REACHED)]


def acks(client: FakeClient) -> list[Ack]:
    """Return the received MISSION_ACKs."""
    return [Ack.of(packet.payload) for packet in client.of_id(MISSION_ACK)]
