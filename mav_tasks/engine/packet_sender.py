"""Output to one endpoint: sequence numbers per source, packing, and the shared packet queue."""

from collections import deque
from dataclasses import dataclass, field
from math import inf

from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import Outgoing, Peer
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import Packet, with_seq
from mav_tasks.mavlink.sequence import SequenceKeeper


@dataclass
class Fence:
    """Until when packets may leave, s: a gateway of a fleet has its vehicles for a term only.

    ``until`` is for our own messages, ``relays_until`` for packets that are forwarded.
    ``is_shared``: the vehicles are a fleet's.
    """

    is_shared: bool = False
    until: float = inf
    relays_until: float = inf


@dataclass(slots=True, repr=False, eq=False)
class PacketSender:
    """Sends to one endpoint of one link, and signs if the endpoint expects it."""

    link: str
    peer: Peer
    _queue: list[Outgoing]
    _packer: Packer
    _signatures: Signatures | None = None
    #: of all packets but those that are sent unfenced
    _fence: Fence = field(default_factory=Fence)
    #: takes each packet, too
    _sent: deque[Outgoing] | None = None
    _sequence: SequenceKeeper = field(default_factory=SequenceKeeper)

    def __repr__(self) -> str:
        return f"PacketSender({self.link}, {self.peer})"

    def sibling(self, queue: list[Outgoing]) -> "PacketSender":
        """Return a sender to the same endpoint that fills another queue and does not sign."""
        return PacketSender(self.link, self.peer, queue, self._packer)

    def shut(self) -> "PacketSender":
        """Return a sender to the same endpoint whose packets never leave."""
        fence = Fence(is_shared=True, until=-inf, relays_until=-inf)
        return PacketSender(self.link, self.peer, self._queue, self._packer, None, fence)

    def forget(self, system_id: int) -> None:
        """Forget the numbers of a system, which another gateway sends from here on."""
        self._sequence.forget(system_id)

    def send(
        self,
        message: Message,
        source: Address,
        *,
        first: bool = False,
        until: float = inf,
        is_fenced: bool = True,
        is_ours: bool = True,
    ) -> None:
        """Send a message of our own in the name of ``source``; see ``Outgoing`` for the options.

        Not ``is_fenced``: it changes nothing at a vehicle, whichever gateway has it. ``is_ours``: a
        vehicle that this gateway has is there.
        """
        raw = self._packer.pack(message, source, seq=self._sequence.injected(source))
        if self._signatures is not None and self._signatures.may_sign:
            raw = self._sealed(raw, is_ours=is_ours)
        until = min(until, self._fence.until) if is_fenced else until
        outgoing = Outgoing(self.link, self.peer, raw, first, until)
        self._queue.append(outgoing)
        if self._sent is not None:
            self._sent.append(outgoing)

    def forward(self, packet: Packet) -> None:
        """Forward a packet; a gap in its source's sequence numbers stays visible."""
        self._relay(packet, self._sequence.forwarded(packet.source, packet.seq))

    def inject(self, packet: Packet) -> None:
        """Forward a packet under our next number, for a source that is heard in several places."""
        self._relay(packet, self._sequence.injected(packet.source))

    def withhold(self, source: Address) -> None:
        """Skip the number of a packet that is not forwarded, so that no gap shows."""
        self._sequence.withheld(source)

    def continue_numbers(self, packet: Packet) -> None:
        """Continue our numbering although the packet's source has restarted its own at 0."""
        self._sequence.continued(packet.source, packet.seq)

    def _relay(self, packet: Packet, seq: int) -> None:
        raw = with_seq(packet, seq)
        if self._signatures is not None and self._signatures.may_sign:
            raw = self._sealed(raw)
        outgoing = Outgoing(self.link, self.peer, raw, until=self._fence.relays_until)
        self._queue.append(outgoing)
        if self._sent is not None:
            self._sent.append(outgoing)

    def _sealed(self, raw: bytes, *, is_ours: bool = True) -> bytes:
        assert self._signatures is not None, "the caller looked"
        is_held = self._fence.is_shared and is_ours
        seal = self._signatures.sealed_as_holder if is_held else self._signatures.sealed
        return seal(self.link, self.peer, raw)
