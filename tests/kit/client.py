"""A fake client on a memory link: plain pymavlink, without the server's codec.

It behaves like a stock client: heartbeats once a second, commands repeated like MAVSDK's if
requested. It stores raw packets and decodes them when a test reads them, because most telemetry is
never read.
"""

import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK

Message = Any  # pymavlink's classes carry no type information

REPEATS = (0.0, 0.5, 1.0, 1.5)  # s, MAVSDK 4.1: byte-identical payload, confirmation 0, new seq

MOVE, ROTATE, DRIVE, STOP = 54000, 54001, 54002, 54003
SET_MODE, PAUSE_CONTINUE, ARM = 176, 193, 400
SET_INTERVAL, REQUEST = 511, 512
TASK_STATUS, TASK_QUEUE_STATUS = 54000, 54001
MANUAL, HOLD, AUTO, RTL, GUIDED = 0, 4, 10, 11, 15

SIGNING_EPOCH = 1_420_070_400  # UTC seconds of 2015-01-01

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)

IDS: dict[str, int] = {cls.msgname: number for number, cls in common.mavlink_map.items()}
ACK = IDS["COMMAND_ACK"]


class TaskStatus(NamedTuple):
    """TASK_STATUS, decoded manually as ``dialects/README.md`` shows."""

    time_boot_ms: int
    task_id: int
    version: int
    nonce: int
    after_task_id: int
    remaining: float
    time_to_start: float
    time_to_finish: float
    execution_time: float
    command: int
    queue_position: int
    step: int
    step_count: int
    target_system: int
    target_component: int
    state: int
    reason: int
    priority: int
    progress: int
    remaining_unit: int
    submitter_system: int
    submitter_component: int
    submitter_link: int
    text: str
    halt_epoch: int
    label: str

    @property
    def why(self) -> tuple[int, int]:
        """(state, reason)."""
        return self.state, self.reason

    @classmethod
    def of(cls, payload: bytes) -> "TaskStatus":
        values = list(struct.unpack("<5I4f4H10B50sI24s", payload.ljust(132, b"\0")))
        for place in (-3, -1):
            values[place] = values[place].rstrip(b"\0").decode()
        return cls._make(values)


@dataclass(slots=True)
class Received:
    """One received packet."""

    at: float
    raw: bytes

    @property
    def message_id(self) -> int:
        return self.raw[7] | self.raw[8] << 8 | self.raw[9] << 16

    @property
    def seq(self) -> int:
        return self.raw[4]

    @property
    def source(self) -> tuple[int, int]:
        return self.raw[5], self.raw[6]

    @property
    def payload(self) -> bytes:
        return self.raw[10 : 10 + self.raw[1]]


@dataclass(slots=True)
class Sent:
    """A command under way, with its answer."""

    message: Message
    at: float
    repeats: tuple[float, ...]
    times_sent: int = 0
    ack: Message | None = None
    acked_at: float = -1.0

    @property
    def result(self) -> int | None:
        return None if self.ack is None else int(self.ack.result)

    @property
    def answer(self) -> tuple[int, int] | None:
        """(result, result_param2) of the ack."""
        return None if self.ack is None else (int(self.ack.result), int(self.ack.result_param2))

    @property
    def task_id(self) -> int:
        assert self.ack is not None, f"not acknowledged: {self.message}"
        assert self.ack.result == ACCEPTED, f"refused: {self.ack}"
        return int(self.ack.result_param2)


@dataclass(slots=True)
class _Stream:
    message: Message
    period: float
    next_at: float


class Role(Protocol):
    """A longer conversation of a client, such as an upload."""

    def next_deadline(self) -> float | None: ...
    def turn(self, *, now: float) -> None: ...
    def take(self, packet: Received, *, now: float) -> None: ...


@dataclass
class FakeClient:
    """One ground station or script, with its own endpoint name."""

    net: MemoryNet
    name: str = "client"
    system_id: int = 255
    component_id: int = 190
    server: str = CLIENT_LINK
    heartbeats: bool = True
    #: requests TASK_STATUS when it first hears a rover: only clients that ask for it get it
    reads_dialect: bool = True
    received: list[Received] = field(default_factory=list)
    #: called with each message and its bytes, before they are sent
    on_sent: Callable[[Message, bytes], None] = lambda *_: None
    last_command: bytes = b""  # as it was sent

    def __post_init__(self) -> None:
        self.link = self.net.link(self.name)
        self._mav = common.MAVLink(None, self.system_id, self.component_id)
        self._decoder = common.MAVLink(None)
        self._verifier: Any = None
        #: packets received while signing: with a valid signature, and without
        self.verified = 0
        self.disbelieved: list[bytes] = []
        self._next_heartbeat = self.net.now
        self._under_way: list[Sent] = []
        self._streams: list[_Stream] = []
        self._has_said_so = False
        self._is_owed_ack = False  # of that request
        self.acks: list[Message] = []
        self.roles: list[Role] = []

    def sign(self, secret: bytes, *, utc: float, link_id: int = 1) -> None:
        """Sign, and accept only packets signed with the same key, by pymavlink's code.

        ``utc`` is the present time of its clock, seconds since 1970.
        """
        self._verifier = common.MAVLink(None)
        for end in (self._mav, self._verifier):
            end.signing.secret_key = secret
            end.signing.link_id = link_id
            end.signing.timestamp = int((utc - SIGNING_EPOCH) * 1e5)
        self._mav.signing.sign_outgoing = True
        self.verified = 0

    def set_clock(self, timestamp: int) -> None:
        """Sign with the time that the client's clock now shows, 10 us since 2015."""
        self._mav.signing.timestamp = timestamp

    def count_anew(self) -> None:
        """Count packets from 0 again, as a program that was started again."""
        self._mav.seq = 0

    def packed(self, message: Message) -> bytes:
        """Return a packet as it would be sent."""
        raw: bytes = message.pack(self._mav)
        return raw

    def _is_believed(self, raw: bytes) -> bool:
        """Return whether pymavlink accepts a packet's signature; unknown ids are not counted."""
        try:
            is_known = self._verifier.decode(bytearray(raw)).get_msgId() >= 0
        except common.MAVError:
            return False
        self.verified += is_known
        return True

    # sending

    def send(self, message: Message) -> bytes:
        """Send one message now; return its bytes."""
        raw: bytes = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        self.on_sent(message, raw)
        self.link.send(self.server, raw)
        return raw

    def send_repeated(self, message: Message) -> bytes:
        """Return a message packed with the next sequence number, for another sender to send."""
        raw: bytes = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw

    def send_raw(self, data: bytes) -> None:
        """Send any bytes now."""
        self.link.send(self.server, data)

    def stream(self, message: Message, *, rate: float) -> None:
        """Send a message periodically, from now on."""
        self._streams.append(_Stream(message, 1.0 / rate, self.net.now))

    def end_streams(self) -> None:
        self._streams.clear()

    def command(
        self,
        command: int,
        *params: float,
        target: tuple[int, int] = (1, 191),
        repeats: tuple[float, ...] = (0.0,),
        confirmation: int = 0,
    ) -> Sent:
        """Send a COMMAND_LONG, repeated at these times until it is acknowledged."""
        message = command_long(command, *params, target=target, confirmation=confirmation)
        return self._submit(message, repeats)

    def command_int(
        self,
        command: int,
        *params: float,
        x: int = 0,
        y: int = 0,
        z: float = 0.0,
        frame: int = 1,
        target: tuple[int, int] = (1, 191),
        repeats: tuple[float, ...] = (0.0,),
    ) -> Sent:
        """Send a COMMAND_INT."""
        filled = (*params, *(0.0,) * (4 - len(params)))
        message = common.MAVLink_command_int_message(
            *target, frame, command, 0, 0, *filled, x, y, z
        )
        return self._submit(message, repeats)

    def move(
        self, distance: float, *, speed: float = 0, priority: float = 5, nonce: int = 0, **kw: Any
    ) -> Sent:
        """Submit TASK_MOVE."""
        return self.command(MOVE, distance, speed, 0, nonce, 0, 0, priority, **kw)

    def rotate(self, angle: float, *, priority: float = 5, nonce: int = 0, **kw: Any) -> Sent:
        """Submit TASK_ROTATE, degrees."""
        return self.command(ROTATE, angle, 0, 0, nonce, 0, 0, priority, **kw)

    def stop(self, *, clear: bool = False, target: tuple[int, int] = (1, 191), **kw: Any) -> Sent:
        """Send TASK_STOP."""
        return self.command(STOP, 1 if clear else 0, target=target, **kw)

    def proceed(self, *, target: tuple[int, int] = (1, 191), **kw: Any) -> Sent:
        """Send DO_PAUSE_CONTINUE(1)."""
        return self.command(PAUSE_CONTINUE, 1, target=target, **kw)

    def pause(self, *, target: tuple[int, int] = (1, 191), **kw: Any) -> Sent:
        """Send DO_PAUSE_CONTINUE(0)."""
        return self.command(PAUSE_CONTINUE, 0, target=target, **kw)

    def mode(self, mode: int, *, target: tuple[int, int] = (1, 1), **kw: Any) -> Sent:
        """Request a mode by command."""
        return self.command(SET_MODE, 1, mode, target=target, **kw)

    def arm(self, armed: bool = True, *, target: tuple[int, int] = (1, 1), **kw: Any) -> Sent:
        """Arm, or disarm."""
        return self.command(ARM, 1 if armed else 0, target=target, **kw)

    def request_status(self, task_id: int, **kw: Any) -> Sent:
        """Request a TASK_STATUS."""
        return self.command(REQUEST, TASK_STATUS, task_id, **kw)

    # receiving

    def decoded(self, packet: Received) -> Message:
        """Return the message of a packet; TASK_STATUS is decoded manually."""
        if packet.message_id == TASK_STATUS:
            return TaskStatus.of(packet.payload)
        return self._decoder.decode(bytearray(packet.raw))

    def of_id(self, message_id: int) -> Iterator[Received]:
        """Return the packets of one message."""
        return (packet for packet in self.received if packet.message_id == message_id)

    def of_type(self, name: str) -> list[Message]:
        """Return the messages of one type received."""
        return [self.decoded(packet) for packet in self.of_id(IDS[name])]

    def heard(self, name: str) -> bool:
        """Return whether a message of this type was received."""
        return any(True for _ in self.of_id(IDS[name]))

    def texts(self) -> list[str]:
        """Return the received STATUSTEXTs, with chunks joined."""
        texts: list[str] = []
        open_id = 0
        for message in self.of_type("STATUSTEXT"):
            if message.id and message.id == open_id and message.chunk_seq:
                texts[-1] += message.text
            else:
                texts.append(message.text)
            open_id = message.id
        return texts

    def said(self, words: str) -> bool:
        """Return whether a received STATUSTEXT has these words."""
        return any(words in text for text in self.texts())

    def statuses(self, task_id: int | None = None) -> list[TaskStatus]:
        """Return the TASK_STATUS messages received, of one task or of all."""
        statuses = [TaskStatus.of(packet.payload) for packet in self.of_id(TASK_STATUS)]
        return [s for s in statuses if task_id in (None, s.task_id)]

    def acks_of(self, command: int) -> list[tuple[int, int]]:
        """Return (result, result_param2) of every ack of a command."""
        return [(a.result, a.result_param2) for a in self.acks if a.command == command]

    def gaps(self, source: tuple[int, int]) -> int:
        """Return the number of missing packets of a source, from its sequence numbers."""
        numbers = [packet.seq for packet in self.received if packet.source == source]
        return sum((after - before - 1) % 256 for before, after in pairwise(numbers))

    # Party

    def next_deadline(self) -> float | None:
        due = [self._next_heartbeat] if self.heartbeats else []
        due += [stream.next_at for stream in self._streams]
        due += [
            sent.at + sent.repeats[sent.times_sent]
            for sent in self._under_way
            if sent.times_sent < len(sent.repeats)
        ]
        due += [at for role in self.roles if (at := role.next_deadline()) is not None]
        return min(due, default=None)

    def turn(self, *, now: float) -> None:
        arrived = self.link.receive(len(self.link.arrived)) if self.link.arrived else ()
        for _, data in arrived:
            if self._verifier is not None and not self._is_believed(data):
                self.disbelieved.append(data)
                continue
            packet = Received(now, data)
            self.received.append(packet)
            if packet.message_id == ACK:
                self._take_ack(self.decoded(packet), now)
            elif self.reads_dialect and not self._has_said_so and packet.source[1] == 1:
                self._has_said_so = self._is_owed_ack = True
                self.send(command_long(SET_INTERVAL, TASK_STATUS, -1, target=packet.source))
            for role in list(self.roles):
                role.take(packet, now=now)
        for role in list(self.roles):
            role.turn(now=now)
        if self.heartbeats and now >= self._next_heartbeat:
            self._next_heartbeat = now + 1.0
            self.send(heartbeat())
        for stream in self._streams:
            if now >= stream.next_at:
                stream.next_at += stream.period
                self.send(stream.message)
        self._send_due(now)

    def _submit(self, message: Message, repeats: tuple[float, ...]) -> Sent:
        sent = Sent(message, self.net.now, repeats)
        self._under_way.append(sent)
        self._send_due(self.net.now)
        return sent

    def _take_ack(self, message: Message, now: float) -> None:
        if self._is_owed_ack and message.command == SET_INTERVAL:
            self._is_owed_ack = False
            return
        self.acks.append(message)
        for sent in self._under_way:
            if sent.message.command == message.command:
                sent.ack, sent.acked_at = message, now
                self._under_way.remove(sent)
                return

    def _send_due(self, now: float) -> None:
        for sent in self._under_way:
            while (
                sent.times_sent < len(sent.repeats)
                and sent.at + sent.repeats[sent.times_sent] <= now
            ):
                sent.times_sent += 1
                self.last_command = self.send(sent.message)


def command_long(
    command: int, *params: float, target: tuple[int, int] = (1, 191), confirmation: int = 0
) -> Message:
    """Return a COMMAND_LONG; missing parameters are 0."""
    filled = (*params, *(0.0,) * (7 - len(params)))
    return common.MAVLink_command_long_message(*target, command, confirmation, *filled)


def heartbeat() -> Message:
    """Return the heartbeat of a ground station."""
    return common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def packed(message: Message, system_id: int, component_id: int, *, seq: int = 0) -> bytes:
    """Return a message as a packet of this address."""
    mav = common.MAVLink(None, system_id, component_id)
    mav.seq = seq
    return bytes(message.pack(mav))


def setpoint(vx: float, yaw_rate: float = 0.0, *, mask: int = 0x05C7, system: int = 1) -> Message:
    """Return a velocity setpoint in the body frame."""
    return common.MAVLink_set_position_target_local_ned_message(
        0, system, 1, 8, mask, 0, 0, 0, vx, 0, 0, 0, 0, 0, 0, yaw_rate
    )


def sticks(x: int = 0, y: int = 0, z: int = 0, r: int = 0, *, system: int = 1) -> Message:
    """Return a MANUAL_CONTROL."""
    return common.MAVLink_manual_control_message(system, x, y, z, r, 0)


def rc_override(*channels: int, system: int = 1) -> Message:
    """Return an RC_CHANNELS_OVERRIDE; missing channels are 0 (released)."""
    filled = (*channels, *(0,) * (8 - len(channels)))
    return common.MAVLink_rc_channels_override_message(system, 1, *filled)


def set_mode(mode: int, *, system: int = 1) -> Message:
    """Return the deprecated message SET_MODE."""
    return common.MAVLink_set_mode_message(system, 1, mode)
