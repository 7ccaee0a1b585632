"""Packets out of bytes that may be cut anywhere: TCP, a serial line, a bridge from one to UDP.

What has a wrong CRC is no packet, whatever its first byte: the search goes on one byte after it.
MAVLink guide, "Packet Serialization".
"""

from collections.abc import Hashable

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

MAX_STREAMS = 256  # per link; one more replaces the oldest


class PeerStreams:
    """The packets of all peers of one link. What one peer sends is one stream.

    A datagram of whole packets stands alone, so that a truncated one before it does not delay it.
    """

    def __init__(self, *, is_stream: bool) -> None:
        """``is_stream``: whether the link delivers pieces of streams, or datagrams."""
        self._is_stream = is_stream
        self._splitters: dict[Hashable, StreamSplitter] = {}
        self.noise = 0  # bytes that belonged to no packet

    def __repr__(self) -> str:
        return f"PeerStreams({self._splitters})"

    def feed(self, peer: Hashable, data: bytes, *, now: float) -> list[Packet]:
        """Return the packets of a peer that are whole with these bytes, in order."""
        alone = [] if self._is_stream else split_datagram(data)
        if len(alone) == 1 and len(alone[0].raw) == len(data) and not self._splitters:
            return alone  # nearly always
        splitter = self._splitters.get(peer)
        is_whole = not self._is_stream and sum([len(each.raw) for each in alone]) == len(data)
        if is_whole and splitter is None:
            return alone
        if not is_whole or not all(map(crc_fits, alone)):
            alone = []
        if splitter is None:
            if len(self._splitters) >= MAX_STREAMS:
                self.forget(next(iter(self._splitters)))
            splitter = self._splitters[peer] = StreamSplitter()
        before = splitter.noise
        packets = [*splitter.end(), *alone] if alone else splitter.feed(data, now=now)
        self.noise += splitter.noise - before
        if alone:
            self.forget(peer)
        return packets

    def forget(self, peer: Hashable) -> None:
        """Forget what a peer left unfinished."""
        self._splitters.pop(peer, None)


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
        packets, used = self._cut(self._rest + data, waits_from=1 if is_late else 0)
        if used > 0 or not kept:
            self._since = now
        return packets

    def end(self) -> list[Packet]:
        """Return the packets that are inside what was kept: nothing continues it."""
        return self._cut(self._rest, waits_from=len(self._rest))[0]

    def _cut(self, data: bytes, *, waits_from: int) -> tuple[list[Packet], int]:
        """Return the packets in these bytes, and how many bytes are done; keep the others.

        A packet that begins before ``waits_from`` and is not whole is none.
        """
        packets: list[Packet] = []
        start, end = 0, len(data)
        while start < end:
            stop = end_of(data, start)
            if stop is not None and stop > end and start >= waits_from:
                break
            packet = None if stop is None or stop > end else _packet(data[start:stop])
            if packet is None:
                start += 1
                self.noise += 1
            else:
                packets.append(packet)
                start += len(packet.raw)
        self._rest = data[start:]
        return packets, start


def has_packet(data: bytes) -> bool:
    """Return whether there is a packet in these bytes."""
    return bool(StreamSplitter().feed(data, now=0.0))


def is_whole(data: bytes) -> bool:
    """Return whether a datagram has whole packets only, by their lengths."""
    start: int | None = 0
    while start is not None and start < len(data):
        start = end_of(data, start)
    return start == len(data)


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
