"""Finds the STOP packets in datagrams above a client's limit: only they are let in."""

import re
from itertools import islice

from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import CRC, HEADER_V1, HEADER_V2, MAGIC_V2, SIGNATURE_LENGTH, SIGNED

_NUMBER = re.escape(int(MavCmd.TASK_STOP).to_bytes(2, "little"))
#: the start of a STOP, MAVLink 1 or 2: COMMAND_INT or COMMAND_LONG, with its command number
_STOP = re.compile(
    rb"\xfe.{4}[\x4b\x4c].{28}" + _NUMBER + rb"|\xfd.{6}[\x4b\x4c]\0\0.{28}" + _NUMBER, re.DOTALL
)
MOST_STOPS = 16  # from one datagram: routers put several packets into one


def stops_in(data: bytes) -> bytes:
    """Return the joined parts of a datagram that look like STOP packets, or b""."""
    found = islice(_STOP.finditer(data), MOST_STOPS)
    return b"".join(_packet_at(data, each.start()) for each in found)


def _packet_at(data: bytes, start: int) -> bytes:
    packet = data[start:]
    if packet[0] == MAGIC_V2:
        is_signed = packet[2] & SIGNED
        return packet[: packet[1] + HEADER_V2 + CRC + (SIGNATURE_LENGTH if is_signed else 0)]
    return packet[: packet[1] + HEADER_V1 + CRC]
