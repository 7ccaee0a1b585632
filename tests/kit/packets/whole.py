"""Finds packets in bytes without the server's code, at every possible start."""

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import common

from mav_tasks.mavlink import messages

#: of pymavlink's own dialect, and of messages that only ours has
CRC_EXTRA = {
    **{number: kind.crc_extra for number, kind in messages.ALL.items()},
    **{number: kind.crc_extra for number, kind in common.mavlink_map.items()},
}
MAGIC_1, MAGIC_2 = 0xFE, 0xFD
LONGEST = 280  # bytes


def has_whole_packet(data: bytes) -> bool:
    """Return whether the bytes contain a packet with a known id and a valid CRC."""
    return any(
        _is_whole(data, start) for start, byte in enumerate(data) if byte in (MAGIC_1, MAGIC_2)
    )


def has_unknown_packet(data: bytes) -> bool:
    """Return whether the bytes may contain a packet with an unknown id (unverifiable)."""
    return any(
        _id_at(data, start) not in (None, *CRC_EXTRA)
        for start, byte in enumerate(data)
        if byte in (MAGIC_1, MAGIC_2)
    )


def _id_at(data: bytes, start: int) -> int | None:
    if data[start] == MAGIC_1:
        return data[start + 5] if start + 8 <= len(data) else None
    return (
        int.from_bytes(data[start + 7 : start + 10], "little") if start + 12 <= len(data) else None
    )


def _is_whole(data: bytes, start: int) -> bool:
    number = _id_at(data, start)
    extra = None if number is None else CRC_EXTRA.get(number)
    if extra is None:
        return False
    end = start + data[start + 1] + (6 if data[start] == MAGIC_1 else 10)
    if end + 2 > len(data):
        return False
    return mcrf4xx(data[start + 1 : end] + bytes((extra,))) == int.from_bytes(
        data[end : end + 2], "little"
    )
