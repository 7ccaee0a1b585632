"""A ground station that sends requests and records messages, with pymavlink's own codec.

It sends only its heartbeat by itself, never a setpoint.
"""

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development as dialect

from rover_sim.check_vehicle.wire import Wire

AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
OURS = (254, 190)  # not 255: an operator's failsafe may watch the heartbeats of 255
NO_VEHICLES = {6, 18, 26, 27}  # MAV_TYPE: ground station, onboard computer, gimbal, ADS-B
ARMED = 128  # MAV_MODE_FLAG
MAVLINK_2 = 0xFD  # the first byte of a packet
COMMAND_LIMIT = 1.0  # s for an answer to a command
AFTERMATH = 0.2  # s in which a duplicate answer would come
PATIENCE = 0.05  # s between two checks of the clock
REORDERED = 8  # packets that another one overtakes; PX4 1.17 sometimes swaps two

COMMAND_ACK, HEARTBEAT, STATUSTEXT = 77, 0, 253


class Heard(NamedTuple):
    """A received message of the vehicle."""

    at: float  # s
    message: Any  # only bytes if pymavlink does not know it
    id: int
    component: int


class Header(NamedTuple):
    """The header; pymavlink decodes it only for messages that it knows."""

    version: int
    sequence: int
    system_id: int
    component: int
    message_id: int


def read_header(packet: bytes) -> Header:
    """Decode a packet's header."""
    if packet[0] == MAVLINK_2:
        return Header(2, packet[4], packet[5], packet[6], int.from_bytes(packet[7:10], "little"))
    return Header(1, packet[2], packet[3], packet[4], packet[5])


class Answer(NamedTuple):
    """The answer to a command."""

    acks: tuple[Heard, ...]  # acks of the command
    took: float  # s until the first

    @property
    def result(self) -> int | None:
        """MAV_RESULT, or None without an answer."""
        return int(self.acks[0].message.result) if self.acks else None

    @property
    def accepted(self) -> bool:
        """Whether the command was accepted."""
        return self.result == 0

    @property
    def refused(self) -> bool:
        """Whether the command was refused with a result that every client knows."""
        return self.result in (1, 2, 3, 4)

    def __str__(self) -> str:
        if self.result is None:
            return f"no answer within {self.took:.1f} s"
        names = dialect.enums["MAV_RESULT"]
        name = names[self.result].name if self.result in names else f"result {self.result}"
        return f"{name.removeprefix('MAV_RESULT_')} after {self.took:.2f} s"


class _Out:
    """The file object that pymavlink writes to."""

    def __init__(self, wire: Wire) -> None:
        self.write = wire.send


class Probe:
    """The link to one vehicle, with a log."""

    def __init__(self, wire: Wire, *, system_id: int | None) -> None:
        self.system_id = system_id  # None until ``find`` finds one: any vehicle
        self.log: list[Heard] = []
        self.packets: Counter[int] = Counter()  # by component
        self.lost: Counter[int] = Counter()  # missing sequence numbers
        self.damaged = 0
        self.mavlink_1 = 0  # packets in MAVLink 1
        self._wire = wire
        self._mav: Any = dialect.MAVLink(_Out(wire), *OURS)
        self._mav.robust_parsing = True
        self._sequence: dict[int, int] = {}
        self._heartbeat_due = wire.now()

    def __repr__(self) -> str:
        return f"Probe(system {self.system_id}, {len(self.log)} heard)"

    @property
    def now(self) -> float:
        """Time of the wire, s."""
        return self._wire.now()

    @property
    def messages(self) -> Any:
        """pymavlink's message builders, ``…_encode``."""
        return self._mav

    def find(self, within: float) -> Heard | None:
        """Wait for a vehicle's heartbeat; return it, or None."""
        end = self.now + within
        while self.now < end:
            self.pump()
            for heard in self.log:
                if heard.id == HEARTBEAT:
                    return heard
        return None

    def send(self, message: Any) -> None:
        """Send a message. Raise ValueError for a setpoint with NaN."""
        if message.get_msgId() in (84, 86) and not all(
            math.isfinite(value) for value in message.to_dict().values() if isinstance(value, float)
        ):
            raise ValueError(f"not a number in {message}")
        self._mav.send(message)

    def pump(self, within: float = PATIENCE) -> None:
        """Receive messages, and send our heartbeat when it is due."""
        if self.now >= self._heartbeat_due:
            self._heartbeat_due = self.now + 1.0
            self._mav.heartbeat_send(6, 8, 0, 0, 4)
        for message in self._mav.parse_buffer(self._wire.receive(within)) or ():
            self._take(message)

    def listen(self, seconds: float) -> None:
        """Receive for ``seconds``."""
        end = self.now + seconds
        while (left := end - self.now) > 0.0:
            self.pump(min(left, PATIENCE))

    def mark(self) -> int:
        """Return a position in the log, for ``since`` and ``wait``."""
        return len(self.log)

    def since(self, mark: int, message_id: int) -> list[Heard]:
        """Return the autopilot's messages with this id since a mark."""
        return [
            heard
            for heard in self.log[mark:]
            if heard.component == AUTOPILOT and heard.id == message_id
        ]

    def last(self, message_id: int) -> Any:
        """Return the autopilot's last message with this id, or None."""
        heard = self._last(message_id)
        return None if heard is None else heard.message

    def silence(self, message_id: int) -> float:
        """Return the seconds since the autopilot's last message with this id."""
        heard = self._last(message_id)
        return math.inf if heard is None else self.now - heard.at

    def wait(
        self,
        message_id: int,
        within: float,
        *,
        since: int,
        condition: Callable[[Any], bool] = lambda _: True,
    ) -> Any:
        """Wait for a message from the mark ``since`` on; return None if it does not come."""
        end = self.now + within
        seen = since
        while True:
            for heard in self.log[seen:]:
                of_kind = heard.id == message_id
                if of_kind and heard.component == AUTOPILOT and condition(heard.message):
                    return heard.message
            seen = len(self.log)
            if self.now >= end:
                return None
            self.pump(min(PATIENCE, max(0.0, end - self.now)))

    def command(self, number: int, *params: float, system_id: int | None = None) -> Answer:
        """Send COMMAND_LONG to the autopilot; wait for its answer and for duplicates."""
        padded = (*params, *(0.0,) * (7 - len(params)))
        target = self.system_id if system_id is None else system_id
        return self._ask(
            number, self._mav.command_long_encode(target, AUTOPILOT, number, 0, *padded)
        )

    def command_int(self, number: int, *params: float) -> Answer:
        """Send COMMAND_INT, without a place; else like ``command``."""
        padded = (*params, *(0.0,) * (4 - len(params)))
        target = (self.system_id, AUTOPILOT)
        return self._ask(
            number, self._mav.command_int_encode(*target, 0, number, 0, 0, *padded, 0, 0, 0.0)
        )

    def texts(self, mark: int) -> str:
        """Return the vehicle's texts since a mark, as a suffix for a line."""
        said = [heard.message.text for heard in self.log[mark:] if _is_text(heard)]
        return f' (it says: "{"; ".join(said[-3:])}")' if said else ""

    @property
    def armed(self) -> bool:
        """Whether the last heartbeat shows the vehicle armed."""
        beat = self.last(HEARTBEAT)
        return beat is not None and bool(beat.base_mode & ARMED)

    @property
    def custom_mode(self) -> int:
        """The mode in the last heartbeat; -1 before the first."""
        beat = self.last(HEARTBEAT)
        return -1 if beat is None else int(beat.custom_mode)

    def _last(self, message_id: int) -> Heard | None:
        for index in range(len(self.log) - 1, -1, -1):
            heard = self.log[index]
            if heard.component == AUTOPILOT and heard.id == message_id:
                return heard
        return None

    def _ask(self, number: int, message: Any) -> Answer:
        mark, began = self.mark(), self.now
        self.send(message)

        def of_this(heard: Heard) -> bool:
            return heard.id == COMMAND_ACK and bool(heard.message.command == number)

        while not any(of_this(heard) for heard in self.log[mark:]):
            if self.now - began >= COMMAND_LIMIT:
                return Answer((), COMMAND_LIMIT)
            self.pump()
        took = next(heard.at for heard in self.log[mark:] if of_this(heard)) - began
        self.listen(AFTERMATH)
        return Answer(tuple(heard for heard in self.log[mark:] if of_this(heard)), took)

    def _take(self, message: Any) -> None:
        if message.get_type() == "BAD_DATA":
            self.damaged += 1
            return
        header = read_header(message.get_msgbuf())
        system_id, component, message_id = header.system_id, header.component, header.message_id
        if self.system_id is None or not self.log:
            is_vehicle = (
                message_id == HEARTBEAT
                and component == AUTOPILOT
                and message.type not in NO_VEHICLES
                and self.system_id in (None, system_id)
            )
            if not is_vehicle:
                return
            self.system_id = system_id
        if system_id != self.system_id:
            return
        self._count(component, header.sequence)
        self.mavlink_1 += header.version == 1
        self.log.append(Heard(self.now, message, message_id, component))

    def _count(self, component: int, sequence: int) -> None:
        before = self._sequence.get(component)
        self.packets[component] += 1
        ahead = 1 if before is None else (sequence - before) % 256
        if ahead > 256 - REORDERED:  # counted as missing when it was overtaken
            self.lost[component] -= 1
            return
        self._sequence[component] = sequence
        self.lost[component] += ahead - 1


def _is_text(heard: Heard) -> bool:
    return heard.id == STATUSTEXT
