"""What the MAVLink addresses at a client's endpoint have said, and in which order.

One memory of packets serves everything that asks for an earlier one: a copy gets the first one's
answer, and a request to go on counts from when its first copy came (``commands/ordering.py``).
"""

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from math import inf

from mav_tasks.engine.services.commands import DOUBLED, SAME_PACKET, Answer, Command
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavResult
from mav_tasks.mavlink.number_line import NumberLine

REMEMBERED = 512  # packets of one endpoint; a gimbal in motion gets 20 a second
OBSERVED = 16  # packets of observers at one endpoint


@dataclass(slots=True, eq=False)
class Said:
    """A command's packet that was taken in; ``answer`` is None until it has been answered."""

    sender: "Sender"
    command: Command
    raw: bytes
    content: Hashable  # of the sender, the same for each copy of the command
    at: float  # s, when it came
    life: int  # of the sender, by its restarts: after one, an equal command is a new one
    twin_at: float  # s, when this very packet came before; -inf: it did not
    #: the vehicle's halt epoch when the first copy came; None: nobody has asked for it
    epoch: int | None = None
    answer: Answer | None = None
    is_held: bool = False  # the answer is known, and waits until the halt is kept
    words: tuple[str, Address] | None = None  # that follow the answer

    @property
    def is_accepted(self) -> bool:
        return self.answer is not None and self.answer.result == MavResult.ACCEPTED

    @property
    def is_refused(self) -> bool:
        return self.answer is not None and self.answer.result != MavResult.ACCEPTED


class Memory:
    """The packets of one endpoint, as long as copies may come, but not more than ``most``."""

    def __init__(self, most: int = REMEMBERED) -> None:
        self.most = most
        self.packets: OrderedDict[bytes, Said] = OrderedDict()
        self.contents: dict[Hashable, list[Said]] = {}

    def forget(self, said: Said) -> None:
        """Forget what equals a packet that is no longer remembered."""
        equal = self.contents[said.content]
        equal.remove(said)
        if not equal:
            del self.contents[said.content]


class Sender:
    """The commands and sequence numbers of one address."""

    def __init__(self, memory: Memory) -> None:
        self.line = NumberLine()
        self._memory = memory

    def __repr__(self) -> str:
        return f"Sender({self.line!r})"

    def same_packet(self, raw: bytes, *, now: float) -> Said | None:
        """Return this very packet, if it came just before: it is given the same answer."""
        said = self._memory.packets.get(raw)
        return said if said is not None and now - said.at <= SAME_PACKET else None

    def take_in(self, command: Command, raw: bytes, *, now: float) -> Said:
        """Remember a command; return the same packet's before if its answer is held still."""
        memory, twin_at = self._memory, -inf
        packets = memory.packets
        if known := packets.get(raw):
            if known.is_held:
                return known
            twin_at = known.at
            memory.forget(packets.pop(raw))
        content = self, command.target, command.command, command.frame, repr(command.params)
        said = packets[raw] = Said(self, command, raw, content, now, self.line.lives, twin_at)
        memory.contents.setdefault(content, []).append(said)
        while len(packets) > memory.most or next(iter(packets.values())).at < now - DOUBLED:
            memory.forget(packets.popitem(last=False)[1])
        return said

    def earlier(self, said: Said, *, now: float, within: float = inf) -> Iterator[Said]:
        """Yield the equal commands of the last so many seconds but this one, the latest first."""
        for each in reversed(self._memory.contents.get(said.content, ())):
            if each is not said and now - each.at <= within:
                yield each
