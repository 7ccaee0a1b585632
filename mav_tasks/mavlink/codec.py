"""Packets to messages and back, around pymavlink's generated classes.

Bytes from outside never raise here: what cannot be decoded is counted and comes back as None.
"""

from dataclasses import dataclass

from mav_tasks.mavlink import _dialect, messages
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import Packet

_dialect.MAVLINK_IGNORE_CRC = 0  # a stray variable of the environment must not switch CRCs off


@dataclass(slots=True)
class DecodeCounts:
    """What a decoder met; packets each."""

    decoded: int = 0
    unknown: int = 0  # message id not in the dialect
    corrupt: int = 0  # CRC or length wrong


class Decoder:
    """Decodes packets that stand alone (a datagram, or one cut out of a stream)."""

    def __init__(self) -> None:
        self._mav = _dialect.MAVLink(None)
        self.counts = DecodeCounts()

    def __repr__(self) -> str:
        return f"Decoder({self.counts})"

    def decode(self, packet: Packet) -> Message | None:
        """Give the message, or None if its id is unknown or its bytes are corrupt."""
        if packet.message_id not in messages.ALL:
            self.counts.unknown += 1
            return None
        try:
            message = self._mav.decode(bytearray(packet.raw))
        except _dialect.MAVError:
            self.counts.corrupt += 1
            return None
        self.counts.decoded += 1
        return message


class Packer:
    """Packs messages of any source; the sequence number is the caller's to keep."""

    def __init__(self) -> None:
        self._mav = _dialect.MAVLink(None)

    def pack(self, message: Message, source: Address, *, seq: int) -> bytes:
        """Give one MAVLink 2 packet."""
        mav = self._mav
        mav.srcSystem, mav.srcComponent, mav.seq = source.system_id, source.component_id, seq
        return message.pack(mav)


class Encoder:
    """Encodes messages of one source; owns that source's sequence number (0–255)."""

    def __init__(self, source: Address, *, first_seq: int = 0) -> None:
        self.source = source
        self._packer = Packer()
        self._next_seq = first_seq

    def __repr__(self) -> str:
        return f"Encoder({self.source}, next_seq={self._next_seq})"

    def encode(self, message: Message) -> bytes:
        """Give one MAVLink 2 packet and advance the sequence number."""
        packed = self._packer.pack(message, self.source, seq=self._next_seq)
        self._next_seq = (self._next_seq + 1) & 0xFF
        return packed


def target_of(message: Message) -> Address:
    """Give the address that a message is targeted at; 0/0 if it names none."""
    return Address(getattr(message, "target_system", 0), getattr(message, "target_component", 0))
