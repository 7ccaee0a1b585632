"""Recent packets that let one vehicle go, by their bytes: the network may deliver one twice.

Each endpoint of a client remembers what came there. A station that is heard on two links, or from a
new port, is several endpoints; a copy has the same bytes.
"""

from collections import OrderedDict
from typing import NamedTuple

from mav_tasks.engine.clients.sender import Sender
from mav_tasks.services.command_receiver import COPIED, DOUBLED

REMEMBERED = 1024  # packets
PRESENT = 3.0  # s since its last packet, in which a sender counts as present


class _Said(NamedTuple):
    sender: Sender
    epoch: int  # the vehicle's halt epoch when the first copy came
    at: float  # s, when the last copy came


class GoWords:
    """The memory of such packets."""

    def __init__(self) -> None:
        self._said: OrderedDict[bytes, _Said] = OrderedDict()

    def __repr__(self) -> str:
        return f"GoWords({len(self._said)})"

    def first_epoch(self, packet: bytes, sender: Sender, *, now: float) -> int | None:
        """Return the halt epoch at which this packet first came elsewhere, or None if it did not.

        If its first sender is gone, the packet counts as a copy for COPIED s only: a restarted
        program sends the same bytes from another port.
        """
        said = self._said.get(packet)
        if said is None or said.sender is sender:
            return None
        within = DOUBLED if now - said.sender.line.heard_at <= PRESENT else COPIED
        return said.epoch if now - said.at <= within else None

    def says(self, packet: bytes, sender: Sender, *, epoch: int, now: float) -> None:
        """Remember a packet; its first sender stays its sender."""
        before = self._said.pop(packet, None)
        is_known = before is not None and now - before.at <= DOUBLED
        who = before.sender if before is not None and is_known else sender
        self._said[packet] = _Said(who, epoch, now)
        if len(self._said) > REMEMBERED:
            self._said.popitem(last=False)
