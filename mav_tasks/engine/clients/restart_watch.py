"""Notices that a rover counts its packets from 0 again, which is a restart and no loss.

Towards clients its numbers then go on where they were: a ground station would count up to 255
packets as lost. What a link really loses stays visible: only after a silence as long as a restart
takes, and for a number near 0, is a gap taken for one.
"""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import Packet

SILENCE = 2.0  # s; the shortest restart of an autopilot seen took 3 s
FIRST_NUMBERS = 32  # of packets that may be lost before the first one that is heard
MOST = 1_000  # sources remembered: anybody can make up 65,536


class RestartWatch:
    """The last number of each source, and when it came."""

    def __init__(self) -> None:
        self._last: dict[Address, tuple[int, float]] = {}

    def begins_anew(self, packet: Packet, *, now: float) -> bool:
        """Return whether the sender of a packet has restarted just before it."""
        last = self._last.pop(packet.source, None)
        if last is None and len(self._last) >= MOST:
            del self._last[next(iter(self._last))]
        self._last[packet.source] = packet.seq, now
        if last is None:
            return False
        number, at = last
        is_next = packet.seq == (number + 1) & 0xFF
        return not is_next and packet.seq < FIRST_NUMBERS and now - at >= SILENCE
