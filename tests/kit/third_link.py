"""A third kind of link, datagrams of one machine: ``unixin:path`` listens, ``unix:path`` dials."""

import socket
from contextlib import suppress
from dataclasses import dataclass, field

from mav_tasks.errors import LinkOpenError
from mav_tasks.links.base import Link, Peer
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.url import NO_OPTIONS, Kind, UrlOptions

KIND = Kind("path", "tests.kit.third_link")
LARGEST = 65_536  # bytes


@dataclass(frozen=True, slots=True)
class UnixUrl:
    """The URL of a socket in the file system."""

    kind: str
    path: str
    options: UrlOptions = field(default=NO_OPTIONS, compare=False)

    def __str__(self) -> str:
        return f"{self.kind}:{self.path}"

    @property
    def is_nearby(self) -> bool:
        """Return True: the kernel carries the datagrams."""
        return True

    @property
    def can_push(self) -> bool:
        """Return False."""
        return False

    def open(self, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()) -> Link:
        """Open the socket."""
        assert not push
        return UnixLink(self)


def parse(kind: str, rest: str, options: UrlOptions, *, what: str) -> UnixUrl:
    """Return the URL."""
    return UnixUrl(kind, rest, options)


class UnixLink:
    """Implements ``Link``."""

    is_local = True
    is_stream = False
    note = ""

    def __init__(self, url: UnixUrl) -> None:
        is_listening = url.kind == "unixin"
        self.name = str(url)
        self.peers: tuple[Peer, ...] = () if is_listening else (url.path,)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(url.path if is_listening else "")  # "": the kernel chooses a name
        except OSError as error:
            self._socket.close()
            raise LinkOpenError(f"link {url} cannot be opened: {error.strerror}") from error

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        received: list[tuple[Peer, bytes]] = []
        with suppress(OSError):
            for _ in range(limit):
                data, peer = self._socket.recvfrom(LARGEST)
                received.append((peer, data))
        return received

    def send(self, peer: Peer, data: bytes) -> None:
        with suppress(OSError):
            self._socket.sendto(data, peer)  # type: ignore[call-overload]

    def close(self) -> None:
        self._socket.close()
