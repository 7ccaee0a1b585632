"""The station as one object in virtual time: bytes in, bytes out, deadlines between."""

from collections import Counter

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.popups import Screen
from tests.kit.qgc.profile import Profile
from tests.kit.qgc.session import Session
from tests.kit.qgc.timers import Timers
from tests.kit.qgc.vehicle import NO_VEHICLES
from tests.kit.qgc.wire import Heard, Message, Source, Wire

HEARTBEAT_EACH = 1.0  # s [1.1]


class Qgc:
    """One QGroundControl. It dials in with a heartbeat each second [11.10], or waits for one."""

    def __init__(self, profile: Profile, *, now: float, dials: bool = True) -> None:
        self.profile = profile
        self.screen = Screen()
        self.wire = Wire(profile)
        self.vehicles: dict[int, Session] = {}
        #: (time, name, message) of every sent message
        self.sent: list[tuple[float, str, Message]] = []
        self._timers = Timers(now=now)
        self._outgoing: list[bytes] = []
        self._is_beating = False
        if dials:
            self._beat()

    def receive(self, data: bytes, *, now: float) -> None:
        """Take a datagram, any bytes."""
        self.handle_deadline(now=now)
        for heard in self.wire.unpack(data):
            self._take(heard)

    def next_deadline(self) -> float | None:
        """Return when ``handle_deadline`` is due."""
        return self._timers.next_deadline()

    def handle_deadline(self, *, now: float) -> None:
        """Do what is due."""
        self._timers.handle_deadline(now=now)

    @property
    def has_packets(self) -> bool:
        """Whether there are packets to send."""
        return bool(self._outgoing)

    def take_packets(self) -> list[bytes]:
        """Return the packets to send, in order."""
        taken, self._outgoing = self._outgoing, []
        return taken

    @property
    def lost(self) -> Counter[Source]:
        """Number of packets that seem lost, by source [1.1]."""
        return Counter({source: count for source, count in self.wire.lost.items() if count})

    def count_sent(self, name: str) -> int:
        """Return the number of sent messages with a name."""
        return sum(1 for _, each, _ in self.sent if each == name)

    def _take(self, heard: Heard) -> None:
        message, name, (system, component) = heard
        session = self.vehicles.get(system)
        if session is not None:
            session.receive(heard)
            return
        is_vehicle = name == "HEARTBEAT" and component == AUTOPILOT and system not in (0, 255)
        if not is_vehicle or message.type in NO_VEHICLES:
            return
        core = Core(self.profile, self._timers, self.screen, self._send, system)
        session = self.vehicles[system] = Session(core, message, self.wire.fall_back)
        if self._is_beating:
            self._send(_heartbeat())  # at once for a new vehicle [1.1]
        else:
            self._beat()
        session.begin()

    def _beat(self) -> None:
        self._is_beating = True
        self._send(_heartbeat())
        self._timers.after(HEARTBEAT_EACH, self._beat)

    def _send(self, message: Message) -> None:
        self.sent.append((self._timers.now, message.get_type(), message))
        self._outgoing.append(self.wire.pack(message))


def _heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(6, 8, 192, 0, 4, 3)  # [11.1]
