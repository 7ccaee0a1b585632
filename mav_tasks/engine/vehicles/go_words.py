"""What was to let one vehicle go, by the bytes of its packets: the net may bring one twice.

Each endpoint of a client has its own memory of what came there. A station that is heard by two
links, or from another port than before, is several endpoints; a copy is the same bytes.
"""

from collections import OrderedDict
from typing import NamedTuple, Protocol

from mav_tasks.mavlink.number_line import NumberLine
from mav_tasks.services.command_receiver import COPIED, DOUBLED

REMEMBERED = 1024  # packets
PRESENT = 3.0  # s since anything of it came, in which a sender is there


class Sender(Protocol):
    """Who has sent a packet, at one endpoint."""

    line: NumberLine


class _Said(NamedTuple):
    sender: Sender
    epoch: int  # of the vehicle, when the first copy came
    at: float  # s, of the last copy


class GoWords:
    """The memory of them."""

    def __init__(self) -> None:
        self._said: OrderedDict[bytes, _Said] = OrderedDict()

    def __repr__(self) -> str:
        return f"GoWords({len(self._said)})"

    def first_epoch(self, packet: bytes, sender: Sender, *, now: float) -> int | None:
        """Return the epoch at which this packet came first, elsewhere; None: it did not.

        Of a sender that is not there any more it is a copy for COPIED s only: a program that is run
        again sends the same bytes from another port.
        """
        said = self._said.get(packet)
        if said is None or said.sender is sender:
            return None
        is_there = now - said.sender.line.heard_at <= PRESENT
        within = DOUBLED if is_there else COPIED
        return said.epoch if now - said.at <= within else None

    def says(self, packet: bytes, sender: Sender, *, epoch: int, now: float) -> None:
        """Remember a packet; the first who has sent it stays its sender."""
        before = self._said.pop(packet, None)
        is_known = before is not None and now - before.at <= DOUBLED
        who = before.sender if before is not None and is_known else sender
        self._said[packet] = _Said(who, epoch, now)
        if len(self._said) > REMEMBERED:
            self._said.popitem(last=False)
