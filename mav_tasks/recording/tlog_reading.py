"""Reads a telemetry log piece by piece; the pieces, joined, are the file. It is untrusted input.

A piece is a packet after its time, as ``tlog_content`` writes it, or what lies between two of them:
the incomplete packet at the end of a log whose writer was killed, or bytes of a damaged disk. Other
programs' logs are read, too, with packets of other dialects and some that have a wrong CRC.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mav_tasks.basics.errors import RecordError
from mav_tasks.mavlink.codec import crc_fits
from mav_tasks.mavlink.packet import (
    CRC,
    HEADER_V1,
    MAGIC_V1,
    MAGIC_V2,
    MAX_PACKET,
    Packet,
    split_datagram,
)
from mav_tasks.mavlink.stream import end_of

STAMP = 8  # bytes of the time, microseconds since 1970, big-endian
BLOCK = 1 << 16  # bytes read at once, and the longest piece between two packets
LONGEST = STAMP + MAX_PACKET
MAGICS = (b"", bytes((MAGIC_V1,)), bytes((MAGIC_V2,)))  # of what follows; "": nothing does


class Piece(NamedTuple):
    """Bytes of a log. ``packet`` is None, and ``stamp`` the last one, between two packets."""

    data: bytes
    stamp: int  # microseconds since 1970
    packet: Packet | None


def pieces(path: Path) -> Iterator[Piece]:
    """Yield the pieces of a file that is no record; raise RecordError if it is no telemetry log."""
    try:
        with path.open("rb") as file:
            yield from _pieces(path, file)
    except OSError as error:
        raise RecordError(f"{path}: {error.strerror}") from error


def _pieces(path: Path, file: BinaryIO) -> Iterator[Piece]:
    data = file.read(BLOCK)
    if _packet_at(data, 0) is None:
        raise RecordError(f"{path}: not a telemetry log" if data else f"{path}: empty")
    is_end = False
    start = stamp = 0
    while len(data) > start:
        if len(data) - start < 2 * LONGEST and not is_end:
            more = file.read(BLOCK)
            is_end = not more
            data, start = data[start:] + more, 0
        packet = _packet_at(data, start)
        if packet is not None:
            stop = start + STAMP + len(packet.raw)
            stamp = int.from_bytes(data[start : start + STAMP])
        else:
            stop = _next_packet(data, start + 1, is_end=is_end)
        yield Piece(data[start:stop], stamp, packet)
        start = stop


def _packet_at(data: bytes, start: int) -> Packet | None:
    """Return the packet whose time begins at ``start``.

    One with a wrong CRC counts if another one, or nothing, follows: it may be of another dialect.
    """
    begin = start + STAMP
    if len(data) < begin + HEADER_V1 + CRC:
        return None
    stop = end_of(data, begin)
    if stop is None or stop > len(data):
        return None
    (packet,) = split_datagram(data[begin:stop])
    if crc_fits(packet) or data[stop + STAMP : stop + STAMP + 1] in MAGICS:
        return packet
    return None


def _next_packet(data: bytes, start: int, *, is_end: bool) -> int:
    """Return where the next packet with its time begins, or where to search on with more data."""
    end = len(data) if is_end else len(data) - LONGEST
    for at in range(start, end):
        packet = _packet_at(data, at)
        if packet is not None and crc_fits(packet):
            return at
    return max(start, end)
