"""Packets out of a stream of bytes that may be cut anywhere: TCP, a serial line. Needs no peer.

What has a wrong CRC is no packet, whatever its first byte: the search goes on one byte after it.
MAVLink guide, "Packet Serialization".
"""

from mav_tasks.mavlink.codec import crc_fits
from mav_tasks.mavlink.packet import (
    CRC,
    HEADER_V1,
    HEADER_V2,
    MAGIC_V1,
    MAGIC_V2,
    SIGNATURE_LENGTH,
    SIGNED,
    Packet,
    split_datagram,
)

#: s, from the first byte of a packet to its last. A false magic byte in noise keeps what follows
#: waiting for as many bytes as it promises; on a quiet link those would be long in coming. (To look
#: for packets inside an unfinished one is no way out: a log that is being downloaded has some.)
PATIENCE = 1.0


class StreamSplitter:
    """Cuts one peer's stream into packets; keeps less than one packet between two calls."""

    def __init__(self) -> None:
        self._rest = b""
        self._since = 0.0  # when the first byte of the rest came
        self.noise = 0  # bytes that belonged to no packet

    def __repr__(self) -> str:
        return f"StreamSplitter({len(self._rest)} bytes kept, {self.noise} of noise)"

    def feed(self, data: bytes, *, now: float) -> list[Packet]:
        """Return the packets that are whole with these bytes, in order."""
        kept = len(self._rest)
        is_late = kept > 0 and now - self._since > PATIENCE
        data = self._rest + data
        packets: list[Packet] = []
        start, end = 0, len(data)
        while start < end:
            stop = end_of(data, start)
            if stop is not None and stop > end and not (is_late and start == 0):
                break
            packet = None if stop is None or stop > end else _packet(data[start:stop])
            if packet is None:
                start += 1
                self.noise += 1
            else:
                packets.append(packet)
                start += len(packet.raw)
        self._rest = data[start:]
        if start > 0 or not kept:
            self._since = now
        return packets


def end_of(data: bytes, start: int) -> int | None:
    """Return where the packet that may begin here ends, as far as can be told; None: none does.

    The end may lie beyond the data.
    """
    magic, there = data[start], len(data) - start
    if magic == MAGIC_V1:
        return start + HEADER_V1 + CRC + (data[start + 1] if there > 1 else 0)
    if magic != MAGIC_V2:
        return None
    stop = start + HEADER_V2 + CRC + (data[start + 1] if there > 1 else 0)
    if there > 2:
        flags = data[start + 2]
        if flags & ~SIGNED:
            return None
        stop += SIGNATURE_LENGTH if flags & SIGNED else 0
    return stop


def _packet(raw: bytes) -> Packet | None:
    (packet,) = split_datagram(raw)
    return packet if crc_fits(packet) else None
