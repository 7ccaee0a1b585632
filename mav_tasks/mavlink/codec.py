"""Packets to messages and back: pymavlink's generated classes, packed and unpacked by ``layout``.

Bytes from outside never raise here: what cannot be decoded is counted and comes back as None.
"""

from dataclasses import dataclass
from struct import Struct

from fastcrc.crc16 import mcrf4xx

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.layout import Layout
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import HEADER_V1, HEADER_V2, MAGIC_V2, Packet, crcs_of_one_byte

_LAYOUTS = {message_id: Layout(message) for message_id, message in messages.ALL.items()}
_HEADER = Struct("<BBBBBBBHB")  # of MAVLink 2


@dataclass(slots=True)
class DecodeCounts:
    """What came in, as far as it was looked at."""

    decoded: int = 0  # packets
    unknown: int = 0  # packets, message id not in the dialect
    corrupt: int = 0  # packets, CRC or length wrong
    noise: int = 0  # bytes that belong to no packet


class Decoder:
    """Decodes packets that stand alone (a datagram, or one cut out of a stream)."""

    def __init__(self) -> None:
        self.counts = DecodeCounts()

    def __repr__(self) -> str:
        return f"Decoder({self.counts})"

    def decode(self, packet: Packet) -> Message | None:
        """Return the message, or None if its id is unknown or its bytes are corrupt.

        Who sent it the packet says: the message has no header.
        """
        layout = _LAYOUTS.get(packet.message_id)
        if layout is None:
            self.counts.unknown += 1
            return None
        raw = packet.raw
        start = HEADER_V2 if raw[0] == MAGIC_V2 else HEADER_V1
        end = start + raw[1]
        crc = mcrf4xx(raw[1:end] + layout.crc_extra)
        if raw[end : end + 2] != crc.to_bytes(2, "little"):
            self.counts.corrupt += 1
            return None
        self.counts.decoded += 1
        size, payload = layout.struct.size, raw[start:end]
        if end - start != size:  # a short payload is filled with zeros, a long one is cut off
            payload = payload[:size].ljust(size, b"\0")
        return layout.message(*layout.order(layout.struct.unpack(payload)))


class Packer:
    """Packs messages of any source; the sequence number is the caller's to keep."""

    def pack(self, message: Message, source: Address, *, seq: int) -> bytes:
        """Return one MAVLink 2 packet."""
        message_id = type(message).id  # in some messages "id" is a field as well
        layout = _LAYOUTS[message_id]
        whole = layout.struct.pack(*layout.values(message))
        payload = whole.rstrip(b"\0") or whole[:1]  # MAVLink 2 keeps the first byte at least
        packet = _HEADER.pack(
            MAGIC_V2,
            len(payload),
            0,
            0,
            seq,
            source.system_id,
            source.component_id,
            message_id & 0xFFFF,
            message_id >> 16,
        )
        packet += payload
        return packet + mcrf4xx(packet[1:] + layout.crc_extra).to_bytes(2, "little")


class Encoder:
    """Encodes messages of one source; owns that source's sequence number (0–255)."""

    def __init__(self, source: Address, *, first_seq: int = 0) -> None:
        self.source = source
        self._packer = Packer()
        self._next_seq = first_seq

    def __repr__(self) -> str:
        return f"Encoder({self.source}, next_seq={self._next_seq})"

    def encode(self, message: Message) -> bytes:
        """Return one MAVLink 2 packet and advance the sequence number."""
        packed = self._packer.pack(message, self.source, seq=self._next_seq)
        self._next_seq = (self._next_seq + 1) & 0xFF
        return packed


def crc_fits(packet: Packet) -> bool:
    """Whether the packet's CRC is right.

    For an id that is not in the dialect: whether it is with any of the 256 CRC_EXTRA that it may
    have, which one of 256 pieces of noise passes.
    """
    raw = packet.raw
    start = HEADER_V2 if raw[0] == MAGIC_V2 else HEADER_V1
    end = start + raw[1]
    given = raw[end] | raw[end + 1] << 8
    layout = _LAYOUTS.get(packet.message_id)
    if layout is not None:
        return bool(mcrf4xx(raw[1:end] + layout.crc_extra) == given)
    return given ^ mcrf4xx(raw[1:end]) >> 8 in crcs_of_one_byte()


def target_of(message: Message) -> Address:
    """Return the address that a message is targeted at; 0/0 if it names none."""
    return Address(getattr(message, "target_system", 0), getattr(message, "target_component", 0))
