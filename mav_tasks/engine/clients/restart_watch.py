"""Detects that a rover restarted: its sequence numbers begin at 0 again.

Its numbers towards clients then continue, because a ground station would count up to 255 packets as
lost. Real losses stay visible: a gap counts as a restart only after a silence as long as a restart
takes, and with a number near 0.
"""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import Packet

SILENCE = 2.0  # s; the shortest restart of an autopilot seen took 3 s
FIRST_NUMBERS = 32  # sequence numbers: some packets may be lost before the first one heard
MOST = 1_000  # sources remembered; a sender can make up 65,536


class RestartWatch:
    """The last sequence number of each source, and when it came."""

    def __init__(self) -> None:
        self._last: dict[Address, tuple[int, float]] = {}

    def forget(self, system_id: int) -> None:
        """Forget all sources in a system."""
        for source in [each for each in self._last if each.system_id == system_id]:
            del self._last[source]

    def begins_anew(self, packet: Packet, *, now: float) -> bool:
        """Return whether the sender of a packet has restarted just before it."""
        number, at = self._last.pop(packet.source, (packet.seq, now))
        if len(self._last) >= MOST:
            del self._last[next(iter(self._last))]
        self._last[packet.source] = packet.seq, now
        is_next = packet.seq == (number + 1) & 0xFF
        return not is_next and packet.seq < FIRST_NUMBERS and now - at >= SILENCE
