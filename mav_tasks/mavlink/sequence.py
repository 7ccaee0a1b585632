"""Sequence numbers of packets that pass through: real loss stays visible, ours causes none.

Outgoing seq = incoming + injected − withheld (mod 256), for each source and receiver.

A rover that restarts begins at 0 again. Its numbers towards clients then continue, because a ground
station would count up to 255 packets as lost. A gap counts as a restart only after a silence as
long as a restart takes, and with a number near 0.
"""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import Packet

#: sources whose numbers are kept; those of more that pass through are left as they came. Anybody
#: can make up 65,536 of them
MOST = 1_000


class SequenceKeeper:
    """The sequence numbers towards one receiver, for each source."""

    def __init__(self) -> None:
        self._offset: dict[Address, int] = {}
        self._next: dict[Address, int] = {}

    def forwarded(self, source: Address, seq: int) -> int:
        """Return the number under which a packet numbered ``seq`` is passed on."""
        number = (seq + self._offset.get(source, 0)) & 0xFF
        if source in self._next or len(self._next) < MOST:
            self._next[source] = (number + 1) & 0xFF
        return number

    def continued(self, source: Address, seq: int) -> None:
        """Note that a source begins anew with ``seq``: that packet follows on the last one."""
        if source in self._next:
            self._offset[source] = (self._next[source] - seq) & 0xFF

    def withheld(self, source: Address) -> None:
        """Note that a packet of the source is not passed on."""
        if source in self._offset or len(self._offset) < MOST:
            self._offset[source] = (self._offset.get(source, 0) - 1) & 0xFF

    def injected(self, source: Address) -> int:
        """Return the number of a packet of our own, put into the source's stream."""
        number, offset = self._next.get(source), self._offset.get(source)
        if number is None or offset is None:
            self._make_room(source)
        number = number or 0
        self._next[source] = (number + 1) & 0xFF
        self._offset[source] = ((offset or 0) + 1) & 0xFF
        return number

    def forget(self, system_id: int) -> None:
        """Forget the numbers of all sources in a system."""
        for numbers in (self._next, self._offset):
            for source in [each for each in numbers if each.system_id == system_id]:
                del numbers[source]

    def _make_room(self, source: Address) -> None:
        for numbers in (self._next, self._offset):
            if source not in numbers and len(numbers) >= MOST:
                del numbers[next(iter(numbers))]  # that one begins anew, which looks like a gap


SILENCE = 2.0  # s; the shortest restart of an autopilot seen took 3 s
FIRST_NUMBERS = 32  # sequence numbers: some packets may be lost before the first one heard


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
