"""A UDP link, listening or dialling: one socket, any number of peers."""

import socket
from zlib import crc32

from mav_tasks.basics.errors import LinkOpenError, LinkUrlError, reason_of
from mav_tasks.links.base import Link, Peer
from mav_tasks.links.endpoint import PORTS, HostUrl, is_loopback, number_in, parse_endpoint
from mav_tasks.links.link_limits import TO_VEHICLES, LinkLimits
from mav_tasks.links.stamps import ROOM, ask_for_stamps, stamp_in
from mav_tasks.links.url import UrlOptions

RECEIVE_BUFFER = 1 << 20  # bytes; a burst of telemetry waits here while the disk is slow
MAX_DATAGRAM = 65536
ANY = {socket.AF_INET: "0.0.0.0", socket.AF_INET6: "::"}
LOOPBACK = {socket.AF_INET: "127.0.0.1", socket.AF_INET6: "::1"}
#: the local ports from which rovers are dialled: below the ephemeral ports (Linux: from 32768), and
#: above those of autopilots (14xxx)
FIRST, COUNT = 16_000, 2_000


class UdpUrl(HostUrl):
    """The URL of a UDP socket: ``udpin:host:port`` listens, ``udpout:host:port`` dials.

    The option ``local=PORT`` is the port from which ``udpout`` dials.
    """

    __slots__ = ()

    can_push = True  # a datagram needs no connection

    def hears(self, host: str, port: int) -> bool:
        """Return whether this socket, which listens, gets what is sent to an address."""
        is_here = self.is_nearby or self.host in ANY.values()
        return port == self.port and (host == self.host or (is_here and is_loopback(host)))

    def open(self, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()) -> Link:
        """Open the socket; a rover is dialled from a port of its own."""
        is_rover_dialled = self.kind == "udpout" and limits is TO_VEHICLES
        local_port = port_for(self.host, self.port) if is_rover_dialled else 0
        return UdpLink(self, push=push, local_port=local_port)


def parse(kind: str, rest: str, options: UrlOptions, *, what: str) -> UdpUrl:
    local = options.others.get("local")
    if local is not None and number_in(local, PORTS) is None:
        raise LinkUrlError(f"{what}: local: expected a port from 1 to 65535")
    return UdpUrl(kind, *parse_endpoint(rest, what=what), options)


class UdpLink:
    """A UDP socket. ``peers``: (host, port) of a dialling link's URL, and of the push addresses."""

    is_stream = False

    def __init__(
        self, url: UdpUrl, *, push: tuple[tuple[str, int], ...] = (), local_port: int = 0
    ) -> None:
        """Open the socket; raise LinkOpenError if that fails.

        A dialling link uses ``local_port`` if that port is free; 0: any. A port that the URL itself
        names must be free.
        """
        self.name = str(url)
        self.note = ""
        self.lost = 0  # datagrams that the system refused
        try:
            family, address = _resolve(url.host, url.port)
            pushed = tuple(_resolve(host, port)[1] for host, port in push)
            self.is_local = url.is_nearby and all(is_loopback(host) for host, _ in push)
            if url.kind == "udpin":
                self._socket = _open(family, address)
            else:
                self._socket = self._dial(family, url, local_port)
        except OSError as error:
            raise LinkOpenError(f"link {url} cannot be opened: {reason_of(error)}") from error
        dialled: tuple[tuple[str, int], ...] = (address,) if url.kind == "udpout" else ()
        self.peers: tuple[Peer, ...] = dialled + pushed

    def __repr__(self) -> str:
        return f"UdpLink({self.name})"

    def _dial(self, family: socket.AddressFamily, url: UdpUrl, preferred: int) -> socket.socket:
        """Open a dialling socket, bound to loopback if all its peers are local."""
        host = LOOPBACK[family] if self.is_local else ANY[family]
        if "local" in url.options.others:
            return _open(family, (host, int(url.options.others["local"])))
        try:
            return _open(family, (host, preferred))
        except OSError:
            self.note = (
                f"local port {preferred} is in use, so another one is used: "
                "a rover that answers only its first sender stays silent until it restarts"
            )
            return _open(family, (host, 0))

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        received: list[tuple[Peer, bytes]] = []
        receive_from = self._socket.recvfrom
        try:
            for _ in range(limit):
                data, peer = receive_from(MAX_DATAGRAM)
                received.append((peer, data))
        except (BlockingIOError, InterruptedError):
            pass
        except OSError:  # an ICMP error for a datagram sent earlier
            self.lost += 1
        return received

    def receive_stamped(self, limit: int) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return the datagrams as ``receive`` does, and the kernel's stamp of each."""
        received: list[tuple[Peer, bytes]] = []
        stamps: list[float] = []
        receive = self._socket.recvmsg
        try:
            for _ in range(limit):
                data, control, _, peer = receive(MAX_DATAGRAM, ROOM)
                received.append((peer, data))
                stamps.append(stamp_in(control))
        except (BlockingIOError, InterruptedError):
            pass
        except OSError:
            self.lost += 1
        return received, stamps

    def send(self, peer: Peer, data: bytes) -> None:
        """Send one datagram; drop it if the system refuses it."""
        try:
            self._socket.sendto(data, peer)  # type: ignore[call-overload]
        except OSError:
            self.lost += 1

    def close(self) -> None:
        self._socket.close()


def port_for(host: str, port: int) -> int:
    """Return the local port for a rover; neighbouring ports of one host get different ones.

    It is always the same: PX4's simulation answers only the first sender that it heard, until it
    restarts.
    """
    return FIRST + (crc32(host.encode()) + port) % COUNT


def _open(family: socket.AddressFamily, bind_to: tuple[str, int]) -> socket.socket:
    sock = socket.socket(family, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        ask_for_stamps(sock)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        sock.bind(bind_to)
    except OSError:
        sock.close()
        raise
    return sock


def _resolve(host: str, port: int) -> tuple[socket.AddressFamily, tuple[str, int]]:
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    return family, (str(address[0]), int(address[1]))
