"""A TCP link that listens: each connection is a peer, (host, port) of its other end.

Anybody can connect, and all who do are accepted at once. While there is room, a connection has a
place at once: the engine knows it, and it hears heartbeats. Without room it waits, which costs
hardly anything, until a place is free or its first packet is there. Then it has a place, and the
oldest guest of the address that has the most of them gives way; so it does for the first connection
of another address. A connection is a guest until a valid packet has come, and beyond
``connections`` for ``unheard`` seconds even if it is heard, so that a STOP always gets in.

The log has a line for each connection that was heard, up to LINES a minute; otherwise lines name
the address only, so that the log writes them once, with their count.
"""

import resource
import selectors
import socket
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from random import SystemRandom

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.crowd import first_of_crowd
from mav_tasks.basics.errors import LinkOpenError, reason_of
from mav_tasks.links.base import Link, Peer, PeerChange, PeerState
from mav_tasks.links.endpoint import HostUrl, parse_endpoint
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.tcp import PIECE, Connection, TcpLink, resolve
from mav_tasks.links.url import UrlOptions

BACKLOG = 1024  # connections that the system queues until they are accepted, and that may wait
SHARE = 4  # of this process's descriptors, one in so many is for those that wait
SPARE = 8  # connections beyond the limit, and new ones in one turn
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


@dataclass(slots=True)
class Waiting:
    """A connection that has no place yet, and what it has said."""

    socket: socket.socket
    peer: tuple[str, int]
    since: float
    said: bytes = b""


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
        self._waiting = selectors.DefaultSelector()  # one descriptor of the other selector
        self._selector.register(self._waiting, selectors.EVENT_READ)
        soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        no_limit = soft == resource.RLIM_INFINITY
        self._most_wait = BACKLOG if no_limit else min(BACKLOG, soft // SHARE)
        self._is_heard: Callable[[Peer], bool] = lambda _peer: True
        self._has_packet: Callable[[bytes], bool] = lambda _data: True
        self._is_signed = False
        self._told: deque[float] = deque(maxlen=LINES)
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._is_accepting = True

    def __repr__(self) -> str:
        return f"TcpInLink({self.name}, {len(self._by_peer)} connections)"

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def watch(
        self,
        is_heard: Callable[[Peer], bool],
        *,
        has_packet: Callable[[bytes], bool],
        is_signed: bool,
    ) -> None:
        self._is_heard, self._has_packet, self._is_signed = is_heard, has_packet, is_signed

    def poll(self) -> None:
        """Check for congestion; close those whose time is over; fill places that are free."""
        self._look()
        for connection in self._by_peer.values():
            if not connection.is_told and self._is_heard(connection.peer):
                words = self._told_as(connection, "connected")
                self._changes.append(PeerChange(connection.peer, PeerState.HEARD, words))
        most = self._limits.connections
        longest = boot_time() - self._limits.unheard
        over = f"{self._limits.unheard:g} s are over"
        if self._is_signed or len(self._by_peer) > most:
            for guest in self._guests():
                if guest.since < longest:
                    self._turn_away(guest, over)
        oldest = [key.data for key in islice(self._waiting.get_map().values(), SPARE)]
        for each in oldest:
            if len(self._by_peer) < most:
                self._place(each)
            elif each.since < longest:
                self._dismiss(each, over)
        if not self._is_accepting:
            self._selector.register(self._socket, selectors.EVENT_READ)
            self._is_accepting = True

    def close(self) -> None:
        for key in list(self._waiting.get_map().values()):
            key.data.socket.close()
        self._waiting.close()
        super().close()
        self._socket.close()

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Close those who give way, as what they said has been handled; then receive."""
        self._make_room()
        return super().receive(limit)

    def _on_ready(self, received: list[tuple[Peer, bytes]], limit: int) -> None:
        """Accept connections; hear them, and as many that wait; give places to up to SPARE.

        Who of many that wait is heard first is chance: nobody can always be before others.
        """
        places, share = SPARE, limit // 2 + 1
        ready = self._waiting.select(0)
        fresh: list[Waiting] = []
        for new in self._accepted(share):
            if places and self._has_room(new):
                self._place(new)
                places -= 1
            else:
                fresh.append(new)
        spoke = SystemRandom().sample(ready, min(share, len(ready)))
        for each in [*fresh, *(key.data for key, _ in spoke)]:
            if places and self._hear(each) and self._place(each):
                received.append((each.peer, each.said))
                places -= 1
        waiting = self._waiting.get_map()
        while len(waiting) > self._most_wait:
            self._dismiss(next(iter(waiting.values())).data, "the link is full")

    def _accepted(self, limit: int) -> Iterator[Waiting]:
        for _ in range(limit):
            try:
                sock, address = self._socket.accept()
            except (BlockingIOError, InterruptedError):
                return
            except ConnectionError:
                continue
            except OSError:  # no descriptors left: the selector would report it again and again
                self._selector.unregister(self._socket)
                self._is_accepting = False
                return
            sock.setblocking(False)
            new = Waiting(sock, (str(address[0]), int(address[1])), boot_time())
            self._waiting.register(sock, selectors.EVENT_READ, new)
            yield new

    def _has_room(self, new: Waiting) -> bool:
        """Return whether one that says nothing has a place: the first of its address, if full."""
        peers = self._by_peer.values()
        return len(peers) < self._limits.connections or (
            all(each.peer[0] != new.peer[0] for each in peers)
            and not all(self._is_heard(each.peer) for each in peers)
        )

    def _hear(self, waiting: Waiting) -> bool:
        """Read; return whether the first packet is there. Close one that never has one."""
        try:
            data = waiting.socket.recv(PIECE - len(waiting.said))
        except (BlockingIOError, InterruptedError):
            return False
        except OSError as error:
            self._dismiss(waiting, reason_of(error))
            return False
        waiting.said += data
        if data and self._has_packet(waiting.said):
            return True
        if not data or len(waiting.said) == PIECE:
            self._dismiss(waiting, "bytes without a packet" if data else "closed by the other end")
        return False

    def _place(self, waiting: Waiting) -> bool:
        """Accept one that waits, also beyond the limit: ``_make_room`` comes next."""
        self._waiting.unregister(waiting.socket)
        try:
            # A peer whose old connection from the same address has not ended yet, or not for the
            # engine, will retry.
            if waiting.peer in self._by_peer or any(
                each.peer == waiting.peer for each in self._changes
            ):
                raise ConnectionRefusedError
            self._add(waiting.socket, waiting.peer, "")
        except OSError:
            self.refused += 1
            waiting.socket.close()
            return False
        return True

    def _make_room(self) -> None:
        """Close guests beyond the limit, and beyond SPARE those that are heard, too."""
        while (beyond := len(self._by_peer) - self._limits.connections) > 0:
            guests = self._guests()
            unheard = [guest for guest in guests if not self._is_heard(guest.peer)]
            if not unheard and beyond <= SPARE:
                break
            oldest = first_of_crowd(unheard or guests, lambda guest: guest.peer[0])
            self._turn_away(oldest, "the link is full")

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

    def _dismiss(self, waiting: Waiting, why: str) -> None:
        """Close one that waits; one line of the log stands for all those of a turn."""
        self.refused += 1
        self._waiting.unregister(waiting.socket)
        waiting.socket.close()
        if not self._changes or self._changes[-1].state is not PeerState.REFUSED:
            words = _unheard(waiting.peer, why)
            self._changes.append(PeerChange(waiting.peer, PeerState.REFUSED, words))

    def _on_ended(self, connection: Connection, reason: str) -> None:
        if connection.is_told or self._is_heard(connection.peer):
            self._end(connection, self._told_as(connection, f"disconnected: {reason}"))
        else:
            self._end(connection, _unheard(connection.peer, reason))

    def _told_as(self, connection: Connection, words: str) -> str:
        """Return the log text for a connection that was heard."""
        connection.is_told = True
        host, port = connection.peer
        now = boot_time()
        if len(self._told) == LINES and now - self._told[0] < LINES_WITHIN:
            return f"{host}: one of many connections {words}"
        self._told.append(now)
        return f"{host}:{port} {words}"


def _unheard(peer: tuple[str, int], reason: str) -> str:
    return f"{peer[0]}: a connection ended without a valid packet: {reason}"


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
