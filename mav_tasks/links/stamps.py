"""The kernel's arrival time of a datagram: SO_TIMESTAMPNS of Linux, socket(7)."""

import socket
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from math import inf

SO_TIMESTAMPNS = 35  # Linux, asm-generic/socket.h; also the type of the control message
_TIMESPEC = struct.Struct("@ll")  # s, ns
ROOM = socket.CMSG_SPACE(_TIMESPEC.size)  # bytes, for the control message


def ask_for_stamps(sock: socket.socket) -> None:
    """Let the kernel stamp each datagram with the wall clock's time, if it can."""
    if sys.platform == "linux":
        with suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)


def stamp_in(control: Iterable[tuple[int, int, bytes]]) -> float:
    """Return the arrival time of a datagram, s since 1970; -inf if there is no stamp."""
    for level, kind, data in control:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS and len(data) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            return float(seconds + nanoseconds * 1e-9)
    return -inf
