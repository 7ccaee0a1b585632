"""The I/O of one end of a conversation on one link: reads, sends, keeps one timer. Decides nothing.

The client and the probe are such ends. The server has a driver of its own, ``runner``: it reads
many links as one batch, and leaves splitting, signatures and peers to the engine.
"""

import asyncio
import time
from collections.abc import Callable
from typing import Protocol

from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.links.base import TEND_PERIOD, Link, Peer, PeerState, StreamLink
from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.stream import PeerStreams

DRAIN = 64  # datagrams read per callback, so that other tasks get to run


class Talk(Protocol):
    """A conversation, sans-I/O. Times are of the loop."""

    def receive(self, packet: Packet, *, now: float) -> None:
        """Process one packet."""

    def next_deadline(self) -> float:
        """Return when to call ``handle_deadline``."""

    def handle_deadline(self, *, now: float) -> None:
        """Do what is due."""

    def take_packets(self) -> list[bytes]:
        """Return the packets to send since the last call, in order."""


class LinkDriver:
    """Runs a conversation on an open link, which it closes."""

    def __init__(self, link: Link, talk: Talk, *, signatures: ClientSignatures | None) -> None:
        """``signatures``: for all packets; None: they are not signed. Call ``begin`` next."""
        self.link = link
        self._stream = link if isinstance(link, StreamLink) else None
        self._talk = talk
        self._signatures = signatures
        self._loop = asyncio.get_running_loop()
        self._peers: dict[Peer, None] = dict.fromkeys(link.peers)
        #: who alone is heard on a link that dials; empty: everybody, who is then answered
        self._dialled = frozenset(() if link.is_stream else link.peers)
        self._streams = PeerStreams(is_stream=link.is_stream)
        self._timer: asyncio.TimerHandle | None = None
        self._tending: asyncio.TimerHandle | None = None
        self._is_closed = False
        #: why the link is down, in words; "" while it is up
        self.is_down = ""

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.link.name}, {self._talk!r})"

    @property
    def now(self) -> float:
        """The loop's time in seconds."""
        return self._loop.time()

    def begin(self) -> None:
        """Read from now on, and do what is due."""
        try:
            self._loop.add_reader(self.link.fileno(), self._step, self._read)
        except BaseException:  # the loop cannot watch it: a virtual-time loop, for instance
            self.link.close()
            raise
        if self._stream is not None:
            self._tend(self._stream)
        self._on_timer()

    def turn(self) -> None:
        """Send the packets of the conversation, and set the timer to its next deadline."""
        if self._is_closed:
            return
        for packet in self._talk.take_packets():
            self.send(packet)
        due = self._talk.next_deadline()
        if self._timer is None or self._timer.when() != due:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._loop.call_at(due, self._on_timer)

    def close(self) -> None:
        """Cancel the timers and close the link."""
        self._is_closed = True
        for timer in (self._timer, self._tending):
            if timer is not None:
                timer.cancel()
        self._timer = self._tending = None
        self._loop.remove_reader(self.link.fileno())
        self.link.close()

    def send(self, data: bytes) -> None:
        """Send a packet to each peer."""
        if self._signatures is not None:
            data = self._signatures.sealed(data, utc=time.time())
        for peer in self._peers:
            self.link.send(peer, data)

    def _step(self, step: Callable[[], None]) -> None:
        """Run one step of the conversation, then ``turn``."""
        step()
        self.turn()

    def _on_up(self) -> None:
        """Note that a peer of a stream link is there."""

    def _on_timer(self) -> None:
        self._timer = None
        self._step(lambda: self._talk.handle_deadline(now=self.now))

    def _read(self) -> None:
        self._take_changes()
        for peer, data in self.link.receive(DRAIN):
            if self._dialled and not self._is_dialled(peer):
                continue
            packets = self._streams.feed(peer, data, now=self.now)
            for packet in filter(self._believes, packets):
                self._peers.setdefault(peer)
                self._talk.receive(packet, now=self.now)
        self._take_changes()

    def _is_dialled(self, peer: Peer) -> bool:
        """Return whether a datagram is of whom we dialled.

        Another server may still send to the port, which a client of its own had before us. If it
        were answered, it would get our commands as well.
        """
        # an IPv6 socket adds flow and scope to host and port
        return (peer[:2] if isinstance(peer, tuple) else peer) in self._dialled

    def _believes(self, packet: Packet) -> bool:
        return self._signatures is None or self._signatures.believes(packet, utc=time.time())

    def _take_changes(self) -> None:
        if self._stream is None:
            return
        for change in self._stream.take_changes():
            if change.state is PeerState.UP:
                self._peers.setdefault(change.peer)
                self.is_down = ""
                self._on_up()
            elif change.state is PeerState.DOWN:
                self._peers.pop(change.peer, None)
                self._streams.forget(change.peer)
                self.is_down = change.words.partition(";")[0] or self.is_down

    def _tend(self, link: StreamLink) -> None:
        self._tending = self._loop.call_later(TEND_PERIOD, self._tend, link)
        link.poll()
        self._step(self._take_changes)
