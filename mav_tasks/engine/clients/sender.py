"""One MAVLink address at a client's endpoint: what it has sent, and in which order."""

from collections import OrderedDict
from collections.abc import Hashable
from math import inf
from typing import NamedTuple

from mav_tasks.mavlink.number_line import NumberLine
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import COPIED, DOUBLED, CommandReceiver

REMEMBERED = 1024  # words: a gimbal that is turned says 20 a second
COPIES = 32  # of one word


class _Said(NamedTuple):
    life: int  # of the sender: a program that is run again says all anew
    epoch: int  # of the vehicle, when the first copy came
    at: float  # s, of the last copy
    packets: frozenset[bytes]  # the latest copies


class Sender:
    """The memory of what one address has sent."""

    def __init__(self) -> None:
        self.commands = CommandReceiver()
        self.line = NumberLine()
        self._said: OrderedDict[Hashable, _Said] = OrderedDict()

    def __repr__(self) -> str:
        return f"Sender({self.line!r}, {len(self._said)} words)"

    def first_epoch(
        self,
        content: Hashable,
        packet: Packet,
        *,
        is_counted: bool,
        is_anothers: bool = False,
        now: float,
    ) -> int | None:
        """Return the epoch at which the first copy of this word came; None: it is none.

        ``is_counted``: it says itself that it is a copy. ``is_anothers``: somebody else has halted
        the vehicle. Then the very same packet is a copy, though its sender seems to run anew: it
        may as well be the net that brings all its packets once more.
        """
        said = self._said.get(content)
        if said is None:
            return None
        if said.life != self.line.lives and not (is_anothers and packet.raw in said.packets):
            return None
        within = DOUBLED if is_counted or packet.raw in said.packets else COPIED
        return said.epoch if now - said.at <= within else None

    def has_said(self, content: Hashable, packet: Packet) -> bool:
        """Return whether this very packet has come before."""
        said = self._said.get(content)
        return said is not None and said.life == self.line.lives and packet.raw in said.packets

    def last_copy_at(self, content: Hashable) -> float:
        """Return when the last copy of this word came, s; -inf: none has."""
        said = self._said.get(content)
        return -inf if said is None or said.life != self.line.lives else said.at

    def says(self, content: Hashable, packet: Packet, *, epoch: int, now: float) -> None:
        """Remember a word, or that one more copy of it has come."""
        before = self._said.pop(content, None)
        packets = frozenset() if before is None or len(before.packets) >= COPIES else before.packets
        self._said[content] = _Said(self.line.lives, epoch, now, packets | {packet.raw})
        if len(self._said) > REMEMBERED:
            self._said.popitem(last=False)
