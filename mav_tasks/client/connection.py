"""The I/O of a Session: reads a link on an asyncio loop, sends, and keeps one timer."""

import asyncio
import time
from collections.abc import Callable

from mav_tasks.client.calls import Call
from mav_tasks.client.session import Session
from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.errors import LinkUrlError
from mav_tasks.links.base import TEND_PERIOD, Link, Peer, PeerState, StreamLink
from mav_tasks.links.link_limits import TO_CLIENTS
from mav_tasks.links.url import parse_url
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.stream import StreamSplitter

DRAIN = 64  # datagrams read per callback, so that other tasks get to run


class Connection:
    """Runs a session on a link. Call ``turn`` after each request to the session."""

    def __init__(
        self,
        link: str | Link,
        make_session: Callable[[float], Session],
        *,
        signatures: ClientSignatures | None = None,
    ) -> None:
        """Open the link. Raise LinkUrlError or LinkOpenError if that fails."""
        self._loop = asyncio.get_running_loop()
        self._signatures = signatures
        self.link = _open(link) if isinstance(link, str) else link
        self.session = make_session(self.now)
        self.session.ask_for_rovers(now=self.now)
        self._peers: dict[Peer, None] = dict.fromkeys(self.link.peers)
        self._splitters: dict[Peer, StreamSplitter] = {}
        self._is_closed = False
        self._timer: asyncio.TimerHandle | None = None
        self._tending: asyncio.TimerHandle | None = None
        try:
            self._loop.add_reader(self.link.fileno(), self._on_readable)
        except BaseException:  # the loop cannot watch it: a virtual-time loop, for instance
            self.link.close()
            raise
        if isinstance(self.link, StreamLink):
            self._tend(self.link)
        self._on_timer()

    def __repr__(self) -> str:
        return f"Connection({self.link.name})"

    @property
    def now(self) -> float:
        """The loop's time in seconds."""
        return self._loop.time()

    def settle(self, call: Call, *, is_answered: bool) -> None:
        """End a call: see ``Calls.settle``. The connection may be closed."""
        self.session.settle(call, is_answered=is_answered, now=self.now)
        self.turn()

    def turn(self) -> None:
        """Send the session's packets, and set the timer to its next deadline."""
        if self._is_closed:
            return
        for packet in self.session.take_packets():
            data = packet
            if self._signatures is not None:
                data = self._signatures.sealed(packet, utc=time.time())
            for peer in self._peers:
                self.link.send(peer, data)
        due = self.session.next_deadline()
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

    def _on_timer(self) -> None:
        self._timer = None
        self.session.handle_deadline(now=self.now)
        self.turn()

    def _on_readable(self) -> None:
        if isinstance(self.link, StreamLink):
            self._take_changes(self.link)
        for peer, data in self.link.receive(DRAIN):
            for packet in self._packets(peer, data):
                if not self._believes(packet):
                    continue
                self._peers.setdefault(peer)
                self.session.receive(packet, now=self.now)
        if isinstance(self.link, StreamLink):
            self._take_changes(self.link)
        self.turn()

    def _packets(self, peer: Peer, data: bytes) -> list[Packet]:
        if not self.link.is_stream:
            return split_datagram(data)
        return self._splitters.setdefault(peer, StreamSplitter()).feed(data, now=self.now)

    def _believes(self, packet: Packet) -> bool:
        return self._signatures is None or self._signatures.believes(packet, utc=time.time())

    def _take_changes(self, link: StreamLink) -> None:
        for change in link.take_changes():
            if change.state is PeerState.UP:
                self._peers.setdefault(change.peer)
                self.session.greet()
                self.session.ask_for_rovers(now=self.now)
            elif change.state is PeerState.DOWN:
                self._peers.pop(change.peer, None)
                self._splitters.pop(change.peer, None)

    def _tend(self, link: StreamLink) -> None:
        self._tending = self._loop.call_later(TEND_PERIOD, self._tend, link)
        link.poll()
        self._take_changes(link)


def _open(link: str) -> Link:
    url = parse_url(link)
    if url.options.key or url.options.unsigned is not None:
        raise LinkUrlError(f"link {link!r}: options after ? are for servers only")
    return url.open(limits=TO_CLIENTS)
