"""The interfaces of links, between the server and its peers."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol, runtime_checkable

Peer = Hashable


class Link(Protocol):
    """One connection to peers, open from its creation until ``close``.

    A link never raises OSError: a failure to open raises LinkOpenError, a later failure is counted.
    """

    name: str
    #: endpoints known beforehand: packets go to them before they have been heard
    peers: tuple[Peer, ...]
    #: whether only this machine can be on the link
    is_local: bool
    #: whether the link is a StreamLink: received data may be cut anywhere
    is_stream: bool
    #: a warning for the operator about how the link was opened; else ""
    note: str

    def fileno(self) -> int:
        """Return the descriptor to wait on for reading; it never changes while the link is open."""

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` available datagrams, or pieces of a stream, with their senders."""

    def send(self, peer: Peer, data: bytes) -> None:
        """Send one packet, or drop it; never block."""

    def close(self) -> None:
        """Close all descriptors."""


@runtime_checkable
class StampedLink(Link, Protocol):
    """A link on which the kernel stamps each datagram with its arrival time."""

    def receive_stamped(self, limit: int) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return the datagrams as ``receive`` does, and when each arrived.

        That is in s by the wall clock; -inf for a datagram without a stamp.
        """


@runtime_checkable
class TimedLink(Link, Protocol):
    """A link that knows for itself when each datagram arrived."""

    def receive_timed(self, limit: int) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return the datagrams as ``receive`` does, and when each arrived, by the server's clock.

        Where that is uncertain, it is the earliest time.
        """


class PeerState(Enum):
    """States of a peer of a stream link."""

    UP = auto()
    HEARD = auto()  # a valid packet has come: for the log
    DOWN = auto()
    REFUSED = auto()  # closed before it was up: for the log
    CONGESTED = auto()  # packets to the peer pile up
    CLEAR = auto()  # no longer congested


@dataclass(frozen=True, slots=True)
class PeerChange:
    """A peer's new state; ``words`` go to the log."""

    peer: Peer
    state: PeerState
    words: str = ""


@runtime_checkable
class StreamLink(Link, Protocol):
    """A link on which peers come and go; ``send`` sends a packet as a whole or not at all."""

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send, queue or drop one packet; ``first`` queues it before all waiting packets."""

    def take_changes(self) -> list[PeerChange]:
        """Return the changes of peers since the last call, in order.

        A change to UP during ``receive`` belongs before the peer's first piece, a change to DOWN
        after its last.
        """

    def poll(self) -> None:
        """Do what is due: dial, flush, check for congestion. Called about every TEND_PERIOD."""


@runtime_checkable
class PacedLink(Link, Protocol):
    #: bytes per second in each direction
    capacity: float


@runtime_checkable
class CountingLink(Link, Protocol):
    @property
    def lost(self) -> int:
        """Number of packets that could not be sent."""


@runtime_checkable
class ListeningLink(Link, Protocol):
    """A link to which others connect. Who sends nothing valid makes room for others."""

    @property
    def refused(self) -> int:
        """Number of connections that were closed for others, or without a valid packet."""

    def watch(
        self,
        is_heard: Callable[[Peer], bool],
        *,
        has_packet: Callable[[bytes], bool],
        is_signed: bool,
    ) -> None:
        """Take whether a valid packet of a peer has come, and whether bytes have a packet.

        ``is_signed``: only signed ones count.
        """


TEND_PERIOD = 0.05  # s
