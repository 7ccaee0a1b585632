"""A ground station that asks and listens: pymavlink's own codec over a wire, and what was heard.

It never sends a setpoint by itself, only its heartbeat.
"""

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development as dialect

from rover_sim.check_vehicle.wire import Wire

AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
OURS = (254, 190)  # not 255: an operator's failsafe may count that one's heartbeats
NO_VEHICLES = {6, 18, 26, 27}  # MAV_TYPE: ground station, onboard computer, gimbal, ADS-B
ARMED = 128  # MAV_MODE_FLAG
MAVLINK_2 = 0xFD  # the first byte of a packet
COMMAND_LIMIT = 1.0  # s for an answer to a command
AFTERMATH = 0.2  # s in which a second answer would come
PATIENCE = 0.05  # s between two looks at the clock
REORDERED = 8  # packets that another one overtakes; PX4 1.17 lets two change places at times

COMMAND_ACK, HEARTBEAT, STATUSTEXT = 77, 0, 253


class Heard(NamedTuple):
    """A message of the vehicle."""

    at: float  # s
    message: Any  # one that pymavlink does not know has no fields, but bytes
    id: int
    component: int


class Header(NamedTuple):
    """What stands before the payload; pymavlink reads it only for messages that it knows."""

    version: int
    sequence: int
    system_id: int
    component: int
    message_id: int


def read_header(packet: bytes) -> Header:
    """Read a packet's header."""
    if packet[0] == MAVLINK_2:
        return Header(2, packet[4], packet[5], packet[6], int.from_bytes(packet[7:10], "little"))
    return Header(1, packet[2], packet[3], packet[4], packet[5])


class Answer(NamedTuple):
    """What came of a command."""

    acks: tuple[Heard, ...]  # those that name the command
    took: float  # s until the first

    @property
    def result(self) -> int | None:
        """MAV_RESULT; None: silence."""
        return int(self.acks[0].message.result) if self.acks else None

    @property
    def accepted(self) -> bool:
        """Whether it was."""
        return self.result == 0

    @property
    def refused(self) -> bool:
        """Whether it was refused, in a way that every client understands."""
        return self.result in (1, 2, 3, 4)

    def __str__(self) -> str:
        if self.result is None:
            return f"no answer within {self.took:.1f} s"
        names = dialect.enums["MAV_RESULT"]
        name = names[self.result].name if self.result in names else f"result {self.result}"
        return f"{name.removeprefix('MAV_RESULT_')} after {self.took:.2f} s"


class _Out:
    """What pymavlink writes to."""

    def __init__(self, wire: Wire) -> None:
        self.write = wire.send


class Probe:
    """One conversation with one vehicle."""

    def __init__(self, wire: Wire, *, system_id: int | None) -> None:
        self.system_id = system_id  # until ``find`` has found one: the one to look for
        self.log: list[Heard] = []
        self.packets: Counter[int] = Counter()  # by component
        self.lost: Counter[int] = Counter()  # sequence numbers that did not come
        self.damaged = 0
        self.mavlink_1 = 0  # packets of the old version
        self._wire = wire
        self._mav: Any = dialect.MAVLink(_Out(wire), *OURS)
        self._mav.robust_parsing = True
        self._sequence: dict[int, int] = {}
        self._heartbeat_due = wire.now()

    def __repr__(self) -> str:
        return f"Probe(system {self.system_id}, {len(self.log)} heard)"

    @property
    def now(self) -> float:
        """The wire's time, s."""
        return self._wire.now()

    @property
    def messages(self) -> Any:
        """What builds messages: pymavlink's ``…_encode``."""
        return self._mav

    def find(self, within: float) -> Heard | None:
        """Wait for a vehicle's heartbeat."""
        end = self.now + within
        while self.now < end:
            self.pump()
            for heard in self.log:
                if heard.id == HEARTBEAT:
                    return heard
        return None

    def send(self, message: Any) -> None:
        """Send a message; none that would put NaN into a setpoint."""
        if message.get_msgId() in (84, 86) and not all(
            math.isfinite(value) for value in message.to_dict().values() if isinstance(value, float)
        ):
            raise ValueError(f"not a number in {message}")
        self._mav.send(message)

    def pump(self, within: float = PATIENCE) -> None:
        """Hear what comes next, and keep our heartbeat going."""
        if self.now >= self._heartbeat_due:
            self._heartbeat_due = self.now + 1.0
            self._mav.heartbeat_send(6, 8, 0, 0, 4)
        for message in self._mav.parse_buffer(self._wire.receive(within)) or ():
            self._take(message)

    def listen(self, seconds: float) -> None:
        """Hear for so long."""
        end = self.now + seconds
        while (left := end - self.now) > 0.0:
            self.pump(min(left, PATIENCE))

    def mark(self) -> int:
        """Return a place in the log, for ``since`` and ``wait``."""
        return len(self.log)

    def since(self, mark: int, message_id: int) -> list[Heard]:
        """Return what was heard of a kind, from the autopilot, since then."""
        return [
            heard
            for heard in self.log[mark:]
            if heard.component == AUTOPILOT and heard.id == message_id
        ]

    def last(self, message_id: int) -> Any:
        """Return the last message of a kind from the autopilot, or None."""
        heard = self._last(message_id)
        return None if heard is None else heard.message

    def silence(self, message_id: int) -> float:
        """Return the seconds since the last message of a kind from the autopilot."""
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
        """Wait for a message of a kind; None if it does not come. ``since``: a mark."""
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
        """Send COMMAND_LONG to the autopilot and wait for the answer, and for a second one."""
        padded = (*params, *(0.0,) * (7 - len(params)))
        target = self.system_id if system_id is None else system_id
        return self._ask(
            number, self._mav.command_long_encode(target, AUTOPILOT, number, 0, *padded)
        )

    def command_int(self, number: int, *params: float) -> Answer:
        """The same by COMMAND_INT, without a place."""
        padded = (*params, *(0.0,) * (4 - len(params)))
        target = (self.system_id, AUTOPILOT)
        return self._ask(
            number, self._mav.command_int_encode(*target, 0, number, 0, 0, *padded, 0, 0, 0.0)
        )

    def texts(self, mark: int) -> str:
        """Return what the vehicle said in words since then, to be added to a line."""
        said = [heard.message.text for heard in self.log[mark:] if _is_text(heard)]
        return f' (it says: "{"; ".join(said[-3:])}")' if said else ""

    @property
    def armed(self) -> bool:
        """Whether its last heartbeat says so."""
        beat = self.last(HEARTBEAT)
        return beat is not None and bool(beat.base_mode & ARMED)

    @property
    def custom_mode(self) -> int:
        """The mode that its last heartbeat says; -1: none yet."""
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
