"""The seam between the server and its peers: what every link can do."""

from collections.abc import Hashable
from typing import Protocol

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

    def fileno(self) -> int:
        """Give the descriptor to wait on for reading."""
        ...

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Give up to ``limit`` datagrams that are there now, each with its sender."""
        ...

    def send(self, peer: Peer, data: bytes) -> None:
        """Send one datagram, or lose it."""
        ...

    def close(self) -> None:
        """Give everything back."""
        ...
