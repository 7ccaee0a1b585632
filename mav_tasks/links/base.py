"""The seam between the server and its peers: what every link can do."""

from collections.abc import Hashable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol, runtime_checkable

Peer = Hashable


class Link(Protocol):
    """One connection to peers, open from its making to ``close``.

    ``OSError`` never leaves a link: what fails at opening raises LinkOpenError, what fails later is
    counted.
    """

    name: str
    #: endpoints known beforehand, to be spoken to first
    peers: tuple[Peer, ...]
    #: whether only this machine can be on it
    is_local: bool
    #: whether what it gives may be cut anywhere; it is a StreamLink then
    is_stream: bool

    def fileno(self) -> int:
        """Return the descriptor to wait on for reading; the same one for as long as it is open."""
        ...

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` datagrams, or pieces, that are there now, each with its sender."""
        ...

    def send(self, peer: Peer, data: bytes) -> None:
        """Send one packet, or lose it; never wait."""
        ...

    def close(self) -> None:
        """Give everything back."""
        ...


@runtime_checkable
class StampedLink(Link, Protocol):
    """A link of which the kernel says when each datagram arrived."""

    def receive_stamped(
        self, limit: int, *, longest: float
    ) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return what ``receive`` gives, and how long each had waited to be read, s.

        ``longest``: nothing has waited for longer; what has no stamp may have.
        """
        ...


class PeerState(Enum):
    """What can become of a peer of a stream link."""

    UP = auto()
    DOWN = auto()
    CONGESTED = auto()  # what is sent to it piles up
    CLEAR = auto()  # no more


@dataclass(frozen=True, slots=True)
class PeerChange:
    """Something became of a peer; ``words`` go to the log."""

    peer: Peer
    state: PeerState
    words: str = ""


@runtime_checkable
class StreamLink(Link, Protocol):
    """A link on which peers come and go; ``send`` sends whole packets or nothing of them."""

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send one packet, or let it wait, ``first`` before all that wait already; or lose it."""
        ...

    def take_changes(self) -> list[PeerChange]:
        """Return what became of peers since the last call, in order.

        Who comes up in one call of ``receive`` does so before its first piece, who goes down after
        its last.
        """
        ...

    def poll(self) -> None:
        """See to what waits for a time: called about every TEND_PERIOD."""
        ...


@runtime_checkable
class PacedLink(Link, Protocol):
    """A link that knows how much it carries."""

    #: bytes a second, each way
    capacity: float


TEND_PERIOD = 0.05  # s
