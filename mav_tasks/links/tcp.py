"""TCP connections, as listening and dialling links share them: pieces in, whole packets out.

No call blocks. Each link has one descriptor, its selector's, which stays the same while connections
come and go.
"""

import selectors
import socket

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import reason_of
from mav_tasks.links.base import Peer, PeerChange, PeerState
from mav_tasks.links.endpoint import HostUrl
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.out_queue import OutQueue

PIECE = 280  # bytes read at once, a MAVLink packet: a piece takes no longer to handle than one
KEEPALIVE = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}  # s, s, times


class Connection:
    """One connection, with its send queue."""

    def __init__(self, sock: socket.socket, peer: tuple[str, int], limits: LinkLimits) -> None:
        self.socket = sock
        self.peer = peer
        self.queue = OutQueue(max_age=limits.max_age)
        self.is_blocked = False  # the socket's buffer is full: waits until it is writable
        self.since = boot_time()
        self.is_told = False  # whether the log says that it is connected

    def __repr__(self) -> str:
        return f"Connection({self.peer}, {self.queue})"


class TcpLink:
    """The base class of TCP links: their connections, with the selector for them."""

    peers: tuple[Peer, ...] = ()
    is_stream = True
    note = ""

    def __init__(self, url: HostUrl, limits: LinkLimits) -> None:
        self.name = str(url)
        self.is_local = url.is_nearby
        self._selector = selectors.DefaultSelector()
        self._lost = 0  # packets without a peer, or dropped by connections that have ended
        self._limits = limits
        self._by_peer: dict[Peer, Connection] = {}
        self._changes: list[PeerChange] = []

    @property
    def lost(self) -> int:
        """Number of packets that were dropped, or had no peer."""
        return self._lost + sum(each.queue.dropped for each in self._by_peer.values())

    def fileno(self) -> int:
        return self._selector.fileno()

    def take_changes(self) -> list[PeerChange]:
        changes, self._changes = self._changes, []
        return changes

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` pieces, the connections in turn; send waiting packets.

        Return as soon as a connection has ended: a new one may come from the same address.
        """
        received: list[tuple[Peer, bytes]] = []
        for _ in range(limit):
            ready = self._selector.select(0) if len(received) < limit else ()
            before = len(self._by_peer)
            for key, events in ready:
                if isinstance(key.data, Connection) and (
                    reason := self._serve(key.data, events, received)
                ):
                    self._on_ended(key.data, reason)
            if not ready or len(self._by_peer) < before:
                break
            if not all(isinstance(key.data, Connection) for key, _ in ready):
                self._on_ready(received, limit)
                break
        return received

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send or queue a packet; drop it if the peer has no connection."""
        connection = self._by_peer.get(peer)
        if connection is None:
            self._lost += 1
            return
        connection.queue.put(data, now=boot_time(), first=first)
        reason = None if connection.is_blocked else self._flush(connection)
        if reason is not None:
            self._on_ended(connection, reason)

    def close(self) -> None:
        """Send waiting packets without blocking, and close everything."""
        for connection in list(self._by_peer.values()):
            self._flush(connection)
            _say_farewell(connection.socket)
            self._end(connection, None)
        self._selector.close()

    def _on_ready(self, received: list[tuple[Peer, bytes]], limit: int) -> None:
        """Handle what is the link's own and ready; add what was read."""
        raise NotImplementedError

    def _on_ended(self, connection: Connection, reason: str) -> None:
        """Call ``_end`` for a connection that has ended."""
        raise NotImplementedError

    def _serve(
        self, connection: Connection, events: int, received: list[tuple[Peer, bytes]]
    ) -> str | None:
        """Read and write without blocking; return the reason if the connection has ended."""
        if events & selectors.EVENT_WRITE:
            connection.is_blocked = False
            self._selector.modify(connection.socket, selectors.EVENT_READ, connection)
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

    def _add(self, sock: socket.socket, peer: tuple[str, int], words: str) -> None:
        """Start to use an established connection; raise OSError if it has failed meanwhile."""
        _prepare(sock, self._limits)
        connection = Connection(sock, peer, self._limits)
        self._selector.register(sock, selectors.EVENT_READ, connection)
        self._by_peer[peer] = connection
        self._changes.append(PeerChange(peer, PeerState.UP, words))

    def _look(self) -> None:
        """Note each congestion that has begun or ended."""
        now = boot_time()
        for connection in self._by_peer.values():
            if connection.queue.changed(now=now):
                is_congested = connection.queue.is_congested
                state = PeerState.CONGESTED if is_congested else PeerState.CLEAR
                self._changes.append(PeerChange(connection.peer, state))

    def _end(self, connection: Connection, words: str | None) -> None:
        """Close a connection; with ``words``, note the change to DOWN."""
        del self._by_peer[connection.peer]
        self._lost += connection.queue.dropped
        self._selector.unregister(connection.socket)
        connection.socket.close()
        if words is not None:
            self._changes.append(PeerChange(connection.peer, PeerState.DOWN, words))

    def _flush(self, connection: Connection) -> str | None:
        queue = connection.queue
        while packet := queue.next(now=boot_time()):
            try:
                queue.wrote(connection.socket.send(packet))
            except (BlockingIOError, InterruptedError):
                both = selectors.EVENT_READ | selectors.EVENT_WRITE
                self._selector.modify(connection.socket, both, connection)
                connection.is_blocked = True
                break
            except OSError as error:
                return reason_of(error)
        return None


def _prepare(sock: socket.socket, limits: LinkLimits) -> None:
    """Set a socket's options: no delay, little buffering, keep-alive and a user time-out."""
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if limits.send_buffer is not None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, limits.send_buffer)
    options = {"TCP_NOTSENT_LOWAT": limits.unsent, "TCP_USER_TIMEOUT": round(limits.give_up * 1e3)}
    for name, value in {**KEEPALIVE, **options}.items():
        if hasattr(socket, name):  # some systems lack some of them
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def resolve(host: str, port: int) -> list[tuple[socket.AddressFamily, tuple[str, int]]]:
    """Return the addresses of a host; raise OSError if it has none."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return [(family, (str(at[0]), int(at[1]))) for family, _, _, _, at in found]


def _say_farewell(sock: socket.socket) -> None:
    """Shut down in order: closing with unread data would reset the connection and lose packets."""
    try:
        sock.shutdown(socket.SHUT_WR)
        for _ in range(64):  # a limit, as the peer may keep sending
            sock.recv(1 << 16)
    except OSError:
        pass
