"""What one MAVLink address at a client's endpoint has sent, and in which order."""

from collections import OrderedDict
from collections.abc import Hashable
from math import inf
from typing import NamedTuple

from mav_tasks.mavlink.number_line import NumberLine
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import COPIED, DOUBLED, CommandReceiver, Pending

REMEMBERED = 1024  # commands of one endpoint; a gimbal in motion gets 20 a second
COPIES = 32  # of one command
OBSERVED = 16  # packets of observers at one endpoint


class _Said(NamedTuple):
    life: int  # of the sender, by its restarts: after one, an equal command is a new one
    epoch: int  # halt epoch of the vehicle when the first copy came
    at: float  # s, of the last copy
    packets: dict[bytes, float]  # the latest copies, and when each came, s
    copies: int  # confirmation of the last one

    def has(self, packet: Packet, now: float) -> bool:
        """Return whether this very packet came lately: numbers go round after 256 packets."""
        return now - self.packets.get(packet.raw, -inf) <= DOUBLED


class Memory:
    """What one endpoint has sent: of bounded size, however many addresses are there."""

    def __init__(self) -> None:
        self.packets: OrderedDict[bytes, Pending] = OrderedDict()
        self.words: OrderedDict[Hashable, _Said] = OrderedDict()


class Sender:
    """The commands and sequence numbers of one address."""

    def __init__(self, memory: Memory) -> None:
        self.commands = CommandReceiver(memory.packets)
        self.line = NumberLine()
        self._said = memory.words

    def __repr__(self) -> str:
        return f"Sender({self.line!r})"

    @classmethod
    def of_observers(cls) -> "Sender":
        """Return what stands for all observers at an endpoint: nothing of theirs lets a rover go,
        so that neither their numbers nor their words are remembered."""
        it = cls(Memory())
        it.commands = CommandReceiver(most=OBSERVED)
        return it

    def first_epoch(
        self,
        content: Hashable,
        packet: Packet,
        *,
        is_counted: bool,
        now: float,
        is_anothers: bool = False,
    ) -> int | None:
        """Return the halt epoch at which a command's first copy came, None if this is no copy.

        ``is_counted``: the packet itself says that it is a copy. ``is_anothers``: another sender
        has halted the vehicle. An identical packet is then a copy even if its sender seems to have
        restarted, because the network may deliver all its packets a second time.
        """
        said = self._said.get((self, content))
        if said is None:
            return None
        is_same = said.has(packet, now)
        if said.life != self.line.lives and not (is_anothers and is_same):
            return None
        within = DOUBLED if is_counted or is_same else COPIED
        return said.epoch if now - said.at <= within else None

    def counts_on(self, content: Hashable, packet: Packet, copies: int, *, within: float) -> bool:
        """Return whether a command's ``confirmation``, ``copies``, makes it a copy of another.

        It is one if the last copy that came says another number: it may be late. Otherwise the
        first may be lost, unless each of the sender's packets ``within`` so many seconds came:
        mavros always says 1.
        """
        said = self._said.get((self, content))
        if said is not None and said.life == self.line.lives and copies != said.copies:
            return copies > 0
        return copies > 0 and not self.line.has_all(packet.seq, within=within)

    def has_said(self, content: Hashable, packet: Packet, *, now: float) -> bool:
        """Return whether this very packet came before, since the sender last restarted."""
        said = self._said.get((self, content))
        return said is not None and said.life == self.line.lives and said.has(packet, now)

    def last_copy_at(self, content: Hashable) -> float:
        """Return when the last copy of this command came, s; -inf: none came."""
        said = self._said.get((self, content))
        return -inf if said is None or said.life != self.line.lives else said.at

    def says(
        self, content: Hashable, packet: Packet, copies: int, *, epoch: int, now: float
    ) -> None:
        """Remember a command, or one more copy of it; ``copies`` is its confirmation."""
        before = self._said.pop((self, content), None)
        packets = {} if before is None or len(before.packets) >= COPIES else before.packets
        packets[packet.raw] = now
        self._said[self, content] = _Said(self.line.lives, epoch, now, packets, copies)
        if len(self._said) > REMEMBERED:
            self._said.popitem(last=False)
