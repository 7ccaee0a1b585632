"""Bytes: pymavlink's own packer and parser, the protocol version, and apparent losses."""

from collections import Counter
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.profile import Profile

Message = Any  # pymavlink's classes carry no type information
Source = tuple[int, int]

PROTOCOL_VERSION = 300  # in no dialect of pymavlink's [11.1]


class Heard(NamedTuple):
    """One received packet whose id the station knows."""

    message: Message
    name: str
    source: Source


class Wire:
    """One end of a link. It starts in MAVLink 1 and switches to the heard version [11.10]."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._packer = mavlink.MAVLink(None, 255, 190)  # [1.1]: the same for every station
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self.sends_mavlink1 = True
        self.may_send_mavlink2 = True
        self.bad = 0  # bytes that are no packet
        self.received: Counter[Source] = Counter()
        self.lost: Counter[Source] = Counter()  # by the gaps between sequence numbers [1.1]
        self._last_seq: dict[Source, int] = {}

    def pack(self, message: Message) -> bytes:
        """Return a message's bytes in the present version."""
        raw: bytes = message.pack(self._packer, force_mavlink1=self.sends_mavlink1)
        self._packer.seq = (self._packer.seq + 1) % 256
        return raw

    def fall_back(self) -> None:
        """Send MAVLink 1 from now on, for good [11.1]."""
        self.sends_mavlink1, self.may_send_mavlink2 = True, False

    def unpack(self, data: bytes) -> list[Heard]:
        """Return the packets of a datagram that this version accepts."""
        heard = []
        for message in self._parser.parse_buffer(data) or ():
            if message.get_type() == "BAD_DATA":
                self.bad += 1
                continue
            packet = _read(message)
            if packet is None:  # the C parser drops unknown ids, which leaves a gap
                continue
            if message.get_msgbuf()[0] == mavlink.PROTOCOL_MARKER_V2:
                self.sends_mavlink1 = not self.may_send_mavlink2
            elif not self._profile.hears_mavlink1 and packet.name != "HEARTBEAT":
                continue
            self._count(packet.source, message.get_msgbuf())
            heard.append(packet)
        return heard

    def _count(self, source: Source, raw: bytes) -> None:
        seq = raw[4] if raw[0] == mavlink.PROTOCOL_MARKER_V2 else raw[2]
        self.received[source] += 1
        if source in self._last_seq:
            self.lost[source] += (seq - self._last_seq[source] - 1) % 256
        self._last_seq[source] = seq


def _read(message: Message) -> Heard | None:
    if not isinstance(message, mavlink.MAVLink_unknown):
        source = message.get_srcSystem(), message.get_srcComponent()
        return Heard(message, message.get_type(), source)
    raw = bytes(message.get_msgbuf())
    if raw[0] == mavlink.PROTOCOL_MARKER_V2 and int.from_bytes(raw[7:10], "little") == (
        PROTOCOL_VERSION
    ):
        return Heard(message, "PROTOCOL_VERSION", (raw[5], raw[6]))
    return None
