"""Packets in and out: splits what links deliver; numbers and packs what goes to one endpoint.

A gateway's lease permits to move its vehicles, then only to stop them, then nothing. A server
without a fleet has no lease, and needs none. ``mav_tasks.fleet`` has the rules of leases; here is
what follows for the packets. They carry the time at which the permission ends, so that also those
are dropped that leave late.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import repeat
from math import inf

from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import LeaseChanged, LinkChanged, Outgoing, Packets, Peer, PeerChanged
from mav_tasks.engine.timers import Effect, Timers, Turn
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import DecodeCounts, Packer
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import Packet, with_seq
from mav_tasks.mavlink.sequence import SequenceKeeper
from mav_tasks.mavlink.stream import PeerStreams


class PacketReader:
    """The unfinished packets of every link."""

    def __init__(self) -> None:
        self._links: dict[str, PeerStreams] = {}

    def __repr__(self) -> str:
        return f"PacketReader({self._links})"

    def change_link(self, change: LinkChanged) -> None:
        """Note whether a link delivers datagrams or streams."""
        self._links.pop(change.link, None)
        if change.up:
            self._links[change.link] = PeerStreams(is_stream=change.is_stream)

    def change_peer(self, change: PeerChanged) -> None:
        """Drop what a peer left unfinished: a new connection starts a new packet."""
        if link := self._links.get(change.link):
            link.forget(change.peer)

    def packets(
        self, item: Packets, counts: DecodeCounts, *, now: float
    ) -> list[tuple[Peer, Packet, float]]:
        """Return (sender, packet, its arrival) for each packet, in order.

        Bytes that belong to no packet go to ``counts``.
        """
        link = self._links.get(item.link)
        if link is None:
            link = self._links[item.link] = PeerStreams(is_stream=False)
        before = link.noise
        taken: list[tuple[Peer, Packet, float]] = []
        for (peer, data), arrived in zip(item.datagrams, item.arrived or repeat(now), strict=False):
            for packet in link.feed(peer, data, now=now):
                taken.append((peer, packet, arrived))  # noqa: PERF401  # nearly always one
        counts.noise += link.noise - before
        return taken


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


SHOWN = 1.5  # s after which heartbeats, one a second, have shown what the end of set-points did


class LeaseWatch(Fence):
    """The present lease: the fence of all packets to vehicles."""

    #: called when its trust has ended, or is back
    on_change: Effect

    def __init__(self, timers: Timers, *, is_shared: bool) -> None:
        """``is_shared``: the vehicles are a fleet's, so that nothing is permitted yet."""
        until = -inf if is_shared else inf
        super().__init__(is_shared, until, until)
        self._timer = timers.timer(Turn.LINKS, self._look)
        #: whether vehicles may be moved
        self.is_trusted = not is_shared
        self._is_leaving = False
        self._back_at = -inf  # s, when it was trusted again
        #: until when packets that stop vehicles may leave, s
        self.stop_until = until

    def __repr__(self) -> str:
        return f"LeaseWatch({'trusted' if self.is_trusted else 'ended'}, {self.until})"

    def change(self, lease: LeaseChanged, *, now: float) -> None:
        """Take a new or renewed lease, or one that has ended."""
        self.relays_until = -inf if self._is_leaving else lease.move_until
        self.stop_until = lease.stop_until
        self._look(now=now)

    def leave(self, *, now: float) -> None:
        """Only stop the vehicles from here on: this gateway leaves the fleet."""
        self._is_leaving, self.is_trusted, self.relays_until = True, False, -inf
        self._look(now=now)

    def has_silenced(self, *, now: float) -> bool:
        """Return whether vehicles may show a failsafe because no set-point was permitted."""
        return self.is_shared and (not self.is_trusted or now - self._back_at <= SHOWN)

    def _look(self, *, now: float) -> None:
        """Look whether vehicles may be moved, or only stopped: it was not renewed in time."""
        was_trusted, self.is_trusted = self.is_trusted, now < self.relays_until
        self.until = self.relays_until if self.is_trusted else self.stop_until
        self._timer.set(self.relays_until if self.is_trusted else inf)
        if was_trusted is not self.is_trusted:
            self._back_at = now if self.is_trusted else self._back_at
            self.on_change(now=now)
