"""A TCP link that dials: one peer; while it is down, an attempt each second."""

import os
import selectors
import socket
from time import monotonic

from mav_tasks.basics.errors import LinkOpenError, reason_of
from mav_tasks.links.attempts import Attempts
from mav_tasks.links.base import Link, PeerChange, PeerState
from mav_tasks.links.endpoint import HostUrl, parse_endpoint
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.tcp import Connection, TcpLink, resolve
from mav_tasks.links.url import UrlOptions

CONNECT_LIMIT = 3.0  # s for the other end to answer


class TcpOutUrl(HostUrl):
    """The URL of a link that dials: ``tcp:host:port``."""

    __slots__ = ()

    def open(self, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()) -> Link:
        assert not push, "only a link that can push gets addresses"
        return TcpOutLink(self, limits=limits)


def parse(kind: str, rest: str, options: UrlOptions, *, what: str) -> TcpOutUrl:
    return TcpOutUrl(kind, *parse_endpoint(rest, what=what), options)


class TcpOutLink(TcpLink):
    """A TCP connection that is dialled again whenever it is lost.

    The host name is resolved once, at start: another look-up could block for seconds.
    """

    def __init__(self, url: HostUrl, *, limits: LinkLimits) -> None:
        self._peer = (url.host, url.port)
        try:
            self._addresses = resolve(url.host, url.port)
        except OSError as error:
            raise LinkOpenError(f"link {url} cannot be opened: {reason_of(error)}") from error
        super().__init__(url, limits)
        self._attempts = Attempts()
        self._dialling: socket.socket | None = None
        self._give_up_at = 0.0

    def __repr__(self) -> str:
        return f"TcpOutLink({self.name}, {'up' if self._by_peer else 'down'})"

    def poll(self) -> None:
        """Dial, or give up an attempt, if that is due; check for congestion."""
        self._look()
        now = monotonic()
        if self._dialling is not None:
            if now >= self._give_up_at:
                self._hang_up("no answer")
        elif not self._by_peer and self._attempts.is_due(now=now):
            self._dial(now)

    def close(self) -> None:
        if self._dialling is not None:
            self._dialling.close()
            self._dialling = None
        super().close()

    def _dial(self, now: float) -> None:
        family, address = self._addresses[0]
        self._addresses = self._addresses[1:] + self._addresses[:1]  # for the next attempt
        self._give_up_at = now + CONNECT_LIMIT
        try:
            self._dialling = socket.socket(family, socket.SOCK_STREAM)
            self._dialling.setblocking(False)
            self._selector.register(self._dialling, selectors.EVENT_WRITE)
            self._dialling.connect(address)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self._hang_up(reason_of(error))
            return
        self._on_ready()

    def _on_ready(self, *_: object) -> None:
        """The connection that was dialled is there, or has failed."""
        sock = self._dialling
        assert sock is not None
        failed = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        try:
            if failed:
                raise OSError(failed, os.strerror(failed))
            if sock.getsockname() == sock.getpeername():  # TCP simultaneous open with itself
                raise ConnectionRefusedError("nobody but this end")
            self._selector.unregister(sock)
            self._dialling = None
            self._add(sock, self._peer, self._attempts.succeeded())
        except OSError as error:
            self._dialling = sock
            self._hang_up(reason_of(error))

    def _hang_up(self, reason: str) -> None:
        if self._dialling is not None:
            if self._dialling in self._selector.get_map():
                self._selector.unregister(self._dialling)
            self._dialling.close()
            self._dialling = None
        words = self._attempts.failed(reason)
        if words is not None:
            self._changes.append(PeerChange(self._peer, PeerState.DOWN, words))

    def _on_ended(self, connection: Connection, reason: str) -> None:
        self._end(connection, self._attempts.failed(reason))
