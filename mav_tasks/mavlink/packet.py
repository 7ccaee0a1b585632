"""A header view over raw MAVLink bytes: split, re-number, strip a signature. Needs no dialect.

Forwarding works on raw packets: an unknown id is passed on whole, and a packet with a bad CRC stays
bad. Nothing here raises on bytes from outside. MAVLink guide, "Packet Serialization".
"""

from functools import cache
from typing import NamedTuple

from mav_tasks.mavlink.address import Address, address_of

MAGIC_V1 = 0xFE
MAGIC_V2 = 0xFD
SIGNED = 0x01  # the only incompat flag there is
SIGNATURE_LENGTH = 13
MAX_PACKET = 280  # 10 header + 255 payload + 2 CRC + 13 signature

HEADER_V1 = 6
HEADER_V2 = 10
CRC = 2


class Packet(NamedTuple):
    """One packet as it came in, with the header fields that routing needs."""

    raw: bytes
    seq: int
    source: Address
    message_id: int

    @property
    def system_id(self) -> int:
        """The sender's system."""
        return self.source.system_id

    @property
    def component_id(self) -> int:
        """The sender's component."""
        return self.source.component_id

    @property
    def is_v2(self) -> bool:
        """Whether the packet is MAVLink 2 (else MAVLink 1)."""
        return self.raw[0] == MAGIC_V2

    @property
    def is_signed(self) -> bool:
        """Whether a MAVLink 2 signature is attached."""
        return self.is_v2 and bool(self.raw[2] & SIGNED)

    @property
    def payload(self) -> bytes:
        """The payload as sent: MAVLink 2 cuts trailing zeros off."""
        start = HEADER_V2 if self.is_v2 else HEADER_V1
        return self.raw[start : start + self.raw[1]]


def split_datagram(data: bytes) -> list[Packet]:
    """Return the whole packets of one datagram, in order.

    Each datagram is parsed afresh, so that a truncated one cannot swallow the next. Bytes between
    packets are skipped; the caller counts them as ``len(data) - sum(len(p.raw))``.
    """
    packets: list[Packet] = []
    start, end = 0, len(data)
    while end - start >= HEADER_V1 + CRC:
        magic = data[start]
        if magic == MAGIC_V2 and end - start >= HEADER_V2 + CRC:
            stop = start + HEADER_V2 + data[start + 1] + CRC
            if data[start + 2] & SIGNED:
                stop += SIGNATURE_LENGTH
            if stop <= end and data[start + 2] & ~SIGNED == 0:
                packets.append(
                    Packet(
                        data[start:stop],
                        data[start + 4],
                        address_of(data[start + 5], data[start + 6]),
                        data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16,
                    )
                )
                start = stop
                continue
        elif magic == MAGIC_V1:
            stop = start + HEADER_V1 + data[start + 1] + CRC
            if stop <= end:
                packets.append(
                    Packet(
                        data[start:stop],
                        data[start + 2],
                        address_of(data[start + 3], data[start + 4]),
                        data[start + 5],
                    )
                )
                start = stop
                continue
        start += 1
    return packets


def with_seq(packet: Packet, seq: int) -> bytes:
    """Return the packet's bytes under another sequence number, unsigned.

    A signature covers the sequence number, so it is taken off; the link that sends puts its own on.
    The CRC is corrected by its linearity and never verified: no CRC_EXTRA is needed, unknown ids
    work, and what was corrupt stays corrupt.
    """
    raw = packet.raw
    if raw[0] == MAGIC_V2:
        raw = _unsigned(raw) if raw[2] & SIGNED else raw
        return raw if raw[4] == seq else _patched(raw, 4, seq)
    return raw if raw[2] == seq else _patched(raw, 2, seq)


def with_payload(packet: Packet, at: int, data: bytes) -> Packet:
    """Return the packet with other bytes in its payload from ``at`` on, unsigned.

    Corrected as in ``with_seq``. Bytes beyond a payload that was cut short are left out.
    """
    raw = _unsigned(packet.raw)
    start = HEADER_V2 if raw[0] == MAGIC_V2 else HEADER_V1
    for index, value in enumerate(data[: max(0, raw[1] - at)], start + at):
        if raw[index] != value:
            raw = _patched(raw, index, value)
    return packet._replace(raw=raw)


def with_flags(raw: bytes, flags: int) -> bytes:
    """Return a MAVLink 2 packet's bytes with other incompat flags, corrected as in ``with_seq``."""
    return _patched(raw, 2, flags)


def _unsigned(raw: bytes) -> bytes:
    if raw[0] == MAGIC_V2 and raw[2] & SIGNED:
        return with_flags(raw[:-SIGNATURE_LENGTH], raw[2] & ~SIGNED)
    return raw


def _patched(raw: bytes, index: int, value: int) -> bytes:
    """Set one byte and carry the change into the CRC.

    crc(a ^ b) == crc(a) ^ crc0(b), with crc0 the CRC from an initial value of 0; ``b`` is the
    changed byte and as many zeros as follow it up to and with CRC_EXTRA (1 in place of 2 CRC
    bytes: ``len(raw) - index - 2``).
    """
    crc = _tail_crcs(len(raw) - index - CRC)[raw[index] ^ value]
    patched = bytearray(raw)
    patched[index] = value
    patched[-2] ^= crc & 0xFF
    patched[-1] ^= crc >> 8
    return bytes(patched)


@cache
def crcs_of_one_byte() -> frozenset[int]:
    """Return what one more byte can put into the upper half of a CRC (see codec)."""
    return frozenset(_tail_crcs(0))


@cache  # at most one table for each packet length there is
def _tail_crcs(zeros: int) -> tuple[int, ...]:
    """CRC (initial value 0) of each byte value followed by ``zeros`` zero bytes.

    Built from the eight single bits, again by linearity, so that the first packet of a length
    costs a millisecond at most.
    """
    table = [0] * 256
    for bit in range(8):
        crc = 1 << bit
        for _ in range(8 * (zeros + 1)):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
        for lower in range(1 << bit):
            table[1 << bit | lower] = table[lower] ^ crc
    return tuple(table)
