"""A TCP link that listens: each connection is a peer, (host, port) of its other end."""

import selectors
import socket

from mav_tasks.errors import LinkOpenError
from mav_tasks.links.base import Link
from mav_tasks.links.endpoint import HostUrl, parse_endpoint
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.tcp import Connection, TcpLink, reason_of, resolve
from mav_tasks.links.url import UrlOptions

BACKLOG = 64  # connections that the system queues until they are accepted


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
        self._is_accepting = False
        self._accept_again()

    def __repr__(self) -> str:
        return f"TcpInLink({self.name}, {len(self._by_peer)} connections)"

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def poll(self) -> None:
        """Check for congestion; accept again after a lack of descriptors."""
        self._look()
        self._accept_again()

    def close(self) -> None:
        super().close()
        self._socket.close()

    def _on_ready(self) -> None:
        """Accept a connection."""
        try:
            sock, address = self._socket.accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError:  # no descriptors left: the selector would report it again and again
            self._selector.unregister(self._socket)
            self._is_accepting = False
            return
        peer = (str(address[0]), int(address[1]))
        try:
            # A peer whose old connection from the same address has not ended yet will retry.
            if len(self._by_peer) >= self._limits.connections or peer in self._by_peer:
                raise ConnectionRefusedError
            self._add(sock, peer, f"{peer[0]}:{peer[1]} connected")
        except OSError:
            self.refused += 1
            sock.close()

    def _accept_again(self) -> None:
        if not self._is_accepting:
            self._selector.register(self._socket, selectors.EVENT_READ)
            self._is_accepting = True

    def _on_ended(self, connection: Connection, reason: str) -> None:
        host, port = connection.peer
        self._end(connection, f"{host}:{port} disconnected: {reason}")


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
