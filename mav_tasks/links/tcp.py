"""TCP connections: pieces in, whole packets out, nothing ever waited for. What both kinds share.

Each link waits on one descriptor, its selector's, whatever becomes of its connections.
"""

import os
import selectors
import socket
from collections.abc import Callable

from mav_tasks.clock import boot_time
from mav_tasks.links.base import Peer, PeerChange, PeerState
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.out_queue import OutQueue
from mav_tasks.links.url import LinkUrl

PIECE = 280  # bytes read at once, a MAVLink packet: a piece takes no longer to handle than one
KEEPALIVE = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}  # s, s, times


class Connection:
    """One connection, and what waits to be sent on it."""

    def __init__(self, sock: socket.socket, peer: Peer, limits: LinkLimits) -> None:
        self.socket = sock
        self.peer = peer
        self.queue = OutQueue(max_age=limits.max_age)
        self.is_blocked = False  # the system takes no more: told when it does again

    def __repr__(self) -> str:
        return f"Connection({self.peer}, {self.queue})"

    @property
    def name(self) -> str:
        """The peer in words."""
        return ":".join(map(str, self.peer)) if isinstance(self.peer, tuple) else str(self.peer)


class Connections:
    """The connections of one link, with the descriptor that tells of them."""

    def __init__(
        self,
        limits: LinkLimits,
        *,
        other: Callable[[], None],
        ended: Callable[[Connection, str], None],
    ) -> None:
        """``other`` sees to what is registered beside connections; ``ended`` is told why one is."""
        self.selector = selectors.DefaultSelector()
        self._lost = 0  # packets that were for nobody, or dropped by who is gone
        self._other = other
        self._ended = ended
        self._limits = limits
        self._by_peer: dict[Peer, Connection] = {}
        self._changes: list[PeerChange] = []

    def __repr__(self) -> str:
        return f"Connections({list(self._by_peer.values())}, {self.lost} packets lost)"

    @property
    def lost(self) -> int:
        """Packets that were dropped, or for nobody."""
        return self._lost + sum(each.queue.dropped for each in self._by_peer.values())

    def __len__(self) -> int:
        return len(self._by_peer)

    def __contains__(self, peer: Peer) -> bool:
        return peer in self._by_peer

    def fileno(self) -> int:
        """Return the selector's descriptor, readable when anything is to be done."""
        return self.selector.fileno()

    def add(self, sock: socket.socket, peer: Peer, words: str) -> None:
        """Take a connection that stands into use. OSError: it does no more."""
        prepare(sock, self._limits)
        connection = Connection(sock, peer, self._limits)
        self.selector.register(sock, selectors.EVENT_READ, connection)
        self._by_peer[peer] = connection
        self._changes.append(PeerChange(peer, PeerState.UP, words))

    def take_changes(self) -> list[PeerChange]:
        """Return what became of peers since the last call."""
        changes, self._changes = self._changes, []
        return changes

    def note(self, change: PeerChange) -> None:
        """Have something told with the next changes."""
        self._changes.append(change)

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` pieces, the connections in turn; send what waits.

        Whoever has ended is the last news: the next to come may come from the very same place.
        """
        received: list[tuple[Peer, bytes]] = []
        for _ in range(limit):
            ready = self.selector.select(0) if len(received) < limit else ()
            before = len(self)
            for key, events in ready:
                if isinstance(key.data, Connection) and (
                    reason := self._serve(key.data, events, received)
                ):
                    self._ended(key.data, reason)
            if not ready or len(self) < before:
                break
            if not all(isinstance(key.data, Connection) for key, _ in ready):
                self._other()
        return received

    def _serve(
        self, connection: Connection, events: int, received: list[tuple[Peer, bytes]]
    ) -> str | None:
        """Read and write what can be; gives why the connection has ended, if it has."""
        if events & selectors.EVENT_WRITE:
            connection.is_blocked = False
            self.selector.modify(connection.socket, selectors.EVENT_READ, connection)
            reason = self._flush(connection)
            if reason is not None:
                return reason
        if not events & selectors.EVENT_READ:
            return None
        try:
            data = connection.socket.recv(PIECE)
        except (BlockingIOError, InterruptedError):
            return None
        except OSError as error:
            return reason_of(error)
        if not data:
            return "closed by the other end"
        received.append((connection.peer, data))
        return None

    def send(self, peer: Peer, data: bytes, *, first: bool) -> None:
        """Send a packet, or let it wait; to who is not there it is lost."""
        connection = self._by_peer.get(peer)
        if connection is None:
            self._lost += 1
            return
        connection.queue.put(data, now=boot_time(), first=first)
        reason = None if connection.is_blocked else self._flush(connection)
        if reason is not None:
            self._ended(connection, reason)

    def look(self) -> None:
        """Tell of congestions that have begun or ended."""
        now = boot_time()
        for connection in self._by_peer.values():
            if connection.queue.changed(now=now):
                is_congested = connection.queue.is_congested
                state = PeerState.CONGESTED if is_congested else PeerState.CLEAR
                self._changes.append(PeerChange(connection.peer, state))

    def end(self, connection: Connection, words: str | None) -> None:
        """Return a connection back; ``words`` tell of it."""
        del self._by_peer[connection.peer]
        self._lost += connection.queue.dropped
        self.selector.unregister(connection.socket)
        connection.socket.close()
        if words is not None:
            self._changes.append(PeerChange(connection.peer, PeerState.DOWN, words))

    def close(self) -> None:
        """Send what can be sent, and give everything back."""
        for connection in list(self._by_peer.values()):
            self._flush(connection)
            _say_farewell(connection.socket)
            self.end(connection, None)
        self.selector.close()

    def _flush(self, connection: Connection) -> str | None:
        queue = connection.queue
        while packet := queue.next(now=boot_time()):
            try:
                queue.wrote(connection.socket.send(packet))
            except (BlockingIOError, InterruptedError):
                both = selectors.EVENT_READ | selectors.EVENT_WRITE
                self.selector.modify(connection.socket, both, connection)
                connection.is_blocked = True
                break
            except OSError as error:
                return reason_of(error)
        return None


class TcpLink:
    """What the links have in common that are made of such connections."""

    peers: tuple[Peer, ...] = ()
    is_stream = True

    def __init__(self, url: LinkUrl, connections: Connections) -> None:
        self.name = str(url)
        self.is_local = url.is_loopback
        self._connections = connections

    @property
    def lost(self) -> int:
        """Packets that were dropped, or for nobody."""
        return self._connections.lost

    def fileno(self) -> int:
        """Return the descriptor of all of it."""
        return self._connections.fileno()

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` pieces, the connections in turn; send what waits."""
        return self._connections.receive(limit)

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send a packet, or let it wait; to who is not there it is lost."""
        self._connections.send(peer, data, first=first)

    def take_changes(self) -> list[PeerChange]:
        """Return what became of peers since the last call."""
        return self._connections.take_changes()


def prepare(sock: socket.socket, limits: LinkLimits) -> None:
    """Have a connection send at once, keep little, and notice when nobody is there any more."""
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if limits.send_buffer is not None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, limits.send_buffer)
    options = {"TCP_NOTSENT_LOWAT": limits.unsent, "TCP_USER_TIMEOUT": round(limits.give_up * 1e3)}
    for name, value in {**KEEPALIVE, **options}.items():
        if hasattr(socket, name):  # not every system has each of them
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def resolve(host: str, port: int) -> list[tuple[socket.AddressFamily, tuple[str, int]]]:
    """Return the addresses that a host has. OSError: it has none."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return [(family, (str(at[0]), int(at[1]))) for family, _, _, _, at in found]


def reason_of(error: OSError) -> str:
    """Return an error in words."""
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno)
    return error.strerror or str(error)


def _say_farewell(sock: socket.socket) -> None:
    """End in order: with something unread a close would take back what was just sent."""
    try:
        sock.shutdown(socket.SHUT_WR)
        for _ in range(64):  # and not for as long as somebody goes on
            sock.recv(1 << 16)
    except OSError:
        pass
