"""A TCP link that listens: each connection is a peer, (host, port) of its other end.

Anybody can connect. So a connection is a guest until a valid packet has come, and gives way to the
next one when the link is full: the oldest guest of the address that has the most of them. Beyond
``connections`` further ones are guests for ``unheard`` seconds even if they are heard, so that a
STOP always gets in. The log has a line for each connection that was heard, up to LINES a minute;
otherwise lines name the address only, so that the log writes them once, with their count.
"""

import selectors
import socket
from collections import deque
from collections.abc import Callable

from mav_tasks.clock import boot_time
from mav_tasks.crowd import first_of_crowd
from mav_tasks.errors import LinkOpenError, reason_of
from mav_tasks.links.base import Link, Peer, PeerChange, PeerState
from mav_tasks.links.endpoint import HostUrl, parse_endpoint
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.tcp import Connection, TcpLink, resolve
from mav_tasks.links.url import UrlOptions

BACKLOG = 1024  # connections that the system queues until they are accepted
SPARE = 8  # connections beyond the limit
LINES = 20  # in LINES_WITHIN
LINES_WITHIN = 60.0  # s


class TcpInUrl(HostUrl):
    """The URL of a link that listens: ``tcpin:host:port``."""

    __slots__ = ()

    def open(self, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()) -> Link:
        assert not push, "only a link that can push gets addresses"
        return TcpInLink(self, limits=limits)


def parse(kind: str, rest: str, options: UrlOptions, *, what: str) -> TcpInUrl:
    return TcpInUrl(kind, *parse_endpoint(rest, what=what), options)


class TcpInLink(TcpLink):
    """A listening TCP socket and its connections."""

    def __init__(self, url: HostUrl, *, limits: LinkLimits) -> None:
        self.refused = 0  # connections
        try:
            family, address = resolve(url.host, url.port)[0]
            self._socket = _listen(family, address)
        except OSError as error:
            raise LinkOpenError(f"link {url} cannot be opened: {reason_of(error)}") from error
        super().__init__(url, limits)
        self._is_heard: Callable[[Peer], bool] = lambda _peer: True
        self._is_signed = False
        self._polled_at = boot_time()
        self._told: deque[float] = deque(maxlen=LINES)
        self._is_accepting = False
        self._accept_again()

    def __repr__(self) -> str:
        return f"TcpInLink({self.name}, {len(self._by_peer)} connections)"

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def watch(self, is_heard: Callable[[Peer], bool], *, is_signed: bool) -> None:
        self._is_heard, self._is_signed = is_heard, is_signed

    def poll(self) -> None:
        """Check for congestion; close guests whose time is over; accept again after a pause."""
        self._look()
        for connection in self._by_peer.values():
            if not connection.is_told and self._is_heard(connection.peer):
                words = self._told_as(connection, "connected")
                self._changes.append(PeerChange(connection.peer, PeerState.HEARD, words))
        if self._is_signed or len(self._by_peer) > self._limits.connections:
            longest = boot_time() - self._limits.unheard
            for guest in self._guests():
                if guest.since < longest:
                    self._turn_away(guest, f"{self._limits.unheard:g} s are over")
        self._polled_at = boot_time()
        self._accept_again()

    def close(self) -> None:
        super().close()
        self._socket.close()

    def _on_ready(self) -> None:
        """Accept a connection; without room for it, leave it waiting until the next ``poll``."""
        if not self._make_room():
            self._pause()
            return
        try:
            sock, address = self._socket.accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError:  # no descriptors left: the selector would report it again and again
            self._pause()
            return
        peer = (str(address[0]), int(address[1]))
        try:
            # A peer whose old connection from the same address has not ended yet, or not for the
            # engine, will retry.
            if peer in self._by_peer or any(each.peer == peer for each in self._changes):
                raise ConnectionRefusedError
            self._add(sock, peer, "")
        except OSError:
            self.refused += 1
            sock.close()

    def _make_room(self) -> bool:
        """Close a guest if the link is full; return whether there is room now.

        A guest that has come since the last ``poll`` stays: its first packet is on its way.
        """
        count, most = len(self._by_peer), self._limits.connections
        if count < most:
            return True
        has_room = count < most + SPARE
        unheard = [guest for guest in self._guests() if not self._is_heard(guest.peer)]
        guests = unheard or ([] if has_room else self._guests())
        if guests:
            oldest = first_of_crowd(guests, lambda guest: guest.peer[0])
            if oldest.since < self._polled_at:
                self._turn_away(oldest, "the link is full")
                return True
        return has_room

    def _guests(self) -> list[Connection]:
        """Return the connections that were not heard, or are too many, the oldest first."""
        room = self._limits.connections
        guests: list[Connection] = []
        for connection in self._by_peer.values():
            if room > 0 and self._is_heard(connection.peer):
                room -= 1
            else:
                guests.append(connection)
        return guests

    def _turn_away(self, guest: Connection, why: str) -> None:
        self.refused += 1
        self._on_ended(guest, why)

    def _pause(self) -> None:
        """Accept no connection before the next ``poll``."""
        self._selector.unregister(self._socket)
        self._is_accepting = False

    def _accept_again(self) -> None:
        if not self._is_accepting:
            self._selector.register(self._socket, selectors.EVENT_READ)
            self._is_accepting = True

    def _on_ended(self, connection: Connection, reason: str) -> None:
        if connection.is_told or self._is_heard(connection.peer):
            self._end(connection, self._told_as(connection, f"disconnected: {reason}"))
        else:
            words = "a connection ended without a valid packet"
            self._end(connection, f"{connection.peer[0]}: {words}: {reason}")

    def _told_as(self, connection: Connection, words: str) -> str:
        """Return the log text for a connection that was heard."""
        connection.is_told = True
        host, port = connection.peer
        now = boot_time()
        if len(self._told) == LINES and now - self._told[0] < LINES_WITHIN:
            return f"{host}: one of many connections {words}"
        self._told.append(now)
        return f"{host}:{port} {words}"


def _listen(family: socket.AddressFamily, address: tuple[str, int]) -> socket.socket:
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(address)
        sock.listen(BACKLOG)
    except OSError:
        sock.close()
        raise
    return sock
