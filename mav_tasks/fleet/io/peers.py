"""Pings between the gateways of a fleet, over UDP: is the other process still there?

Each gateway asks every other one ten times a second, over a connected socket. The answer repeats
the question's random number, and both are authenticated with the fleet's secret, so that nobody
else can answer in its place. If the process has ended, its host's kernel says that nobody listens
at the port (ICMP port unreachable). A firewall in between may say the same: it counts only if it
comes from the host itself, which Linux tells (IP_RECVERR); elsewhere no refusal counts.

A datagram is a kind (1 byte), a random number (16), an epoch (8), a name and a tag (16).
"""

import ipaddress
import secrets
import selectors
import socket
import struct
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from hashlib import blake2b
from hmac import compare_digest

from mav_tasks.fleet.io.endpoint import Endpoint

_ASKS, _ANSWERS = b"?", b"!"
_NONCE, _TAG = 16, 16  # bytes
_LONGEST = 1024  # bytes of a datagram
_AT_A_TIME = 64  # datagrams of a socket before others have their turn
_OUTSTANDING = 10  # pings whose answer still counts

#: linux/in.h, linux/in6.h: report ICMP errors, with the host that sent them
_RECVERR = {socket.AF_INET: (socket.IPPROTO_IP, 11), socket.AF_INET6: (socket.IPPROTO_IPV6, 25)}
#: linux/errqueue.h: struct sock_extended_err (errno, origin, type, code, …); the sender follows it
_ERROR = struct.Struct("=IBBBBII")
#: family -> origin (SO_EE_ORIGIN_ICMP, …_ICMP6), type and code of port unreachable (RFC 792, 4443)
_REFUSAL = {socket.AF_INET: (2, 3, 3), socket.AF_INET6: (3, 1, 4)}
#: family -> where the address is in a sockaddr
_ADDRESS = {socket.AF_INET: slice(4, 8), socket.AF_INET6: slice(8, 24)}


class Sign(Enum):
    """What was seen of another gateway's process."""

    ANSWERED = "answered"
    REFUSED = "refused"  # its host says that nobody listens there


@dataclass(frozen=True, slots=True)
class Seen:
    """A sign of another gateway's process, which was there, or not any more, at ``at`` or later."""

    name: str
    sign: Sign
    at: float


@dataclass
class _Peer:
    """Another gateway, and the pings to it that may still be answered."""

    endpoint: Endpoint
    socket: socket.socket
    sent: dict[bytes, float] = field(default_factory=dict)  # random number -> when


class Peers:
    """Answers pings, and asks the others. Nothing here blocks or raises, but the constructor."""

    def __init__(self, selector: selectors.BaseSelector, host: str, port: int = 0) -> None:
        """Bind a UDP port of an IP address; 0: any. Raise OSError, ValueError: no IP address."""
        self._selector = selector
        self._secret = b""
        self._peers: dict[str, _Peer] = {}
        self._socket = _udp_socket(host)
        try:
            self._socket.bind((host, port))
        except BaseException:
            self._socket.close()
            raise
        self.port: int = self._socket.getsockname()[1]
        selector.register(self._socket, selectors.EVENT_READ)

    def __repr__(self) -> str:
        return f"Peers(port {self.port}, {sorted(self._peers)})"

    def begin(self, secret: bytes) -> None:
        """Use the fleet's secret; nothing is asked or answered without one."""
        self._secret = blake2b(secret).digest()

    def update(self, endpoints: Mapping[str, Endpoint]) -> None:
        """Take the others' present endpoints, by name."""
        for name, peer in tuple(self._peers.items()):
            if endpoints.get(name) != peer.endpoint:
                self._forget(name)
        for name, endpoint in endpoints.items():
            if name not in self._peers:
                with suppress(
                    OSError, ValueError, OverflowError
                ):  # an address of no use from here: no pings
                    self._peers[name] = _Peer(endpoint, self._connected(endpoint))

    def ask(self, now: float) -> None:
        """Ask each of them."""
        for name, peer in self._peers.items():
            nonce = secrets.token_bytes(_NONCE)
            peer.sent[nonce] = now
            while len(peer.sent) > _OUTSTANDING:
                del peer.sent[next(iter(peer.sent))]
            with suppress(OSError):  # also an error of an earlier datagram; ``_errors`` tells it
                peer.socket.send(self._datagram(_ASKS, nonce, peer.endpoint.epoch, name))

    def receive(self, name: str, epoch: int, *, now: float) -> list[Seen]:
        """Answer what has come, as the gateway of this name and epoch; return what was seen."""
        self._answer(name, epoch)
        seen: list[Seen] = []
        for other, peer in self._peers.items():
            for kind, nonce, of, told in self._read(peer.socket):
                sent = peer.sent.pop(nonce, None)
                is_its = (kind, told, of) == (_ANSWERS, other, peer.endpoint.epoch)
                if is_its and sent is not None:
                    seen.append(Seen(other, Sign.ANSWERED, sent))
            if _is_refused(peer):
                seen.append(Seen(other, Sign.REFUSED, now))
        return seen

    def close(self) -> None:
        """Close all sockets: others learn from it that this process has ended."""
        for name in tuple(self._peers):
            self._forget(name)
        self._selector.unregister(self._socket)
        self._socket.close()

    def _answer(self, name: str, epoch: int) -> None:
        for _ in range(_AT_A_TIME):
            try:
                data, sender = self._socket.recvfrom(_LONGEST)
            except BlockingIOError:
                return
            except OSError:
                continue
            found = self._parsed(data)
            if found is not None and found[0] == _ASKS and found[2:] == (epoch, name):
                with suppress(OSError):
                    self._socket.sendto(self._datagram(_ANSWERS, found[1], epoch, name), sender)

    def _read(self, source: socket.socket) -> Iterator[tuple[bytes, bytes, int, str]]:
        for _ in range(_AT_A_TIME):
            try:
                data = source.recv(_LONGEST)
            except BlockingIOError:
                return
            except OSError:  # an error of an earlier datagram
                continue
            found = self._parsed(data)
            if found is not None:
                yield found

    def _datagram(self, kind: bytes, nonce: bytes, epoch: int, name: str) -> bytes:
        body = kind + nonce + epoch.to_bytes(8, "big") + name.encode()
        return body + self._tag(body)

    def _parsed(self, data: bytes) -> tuple[bytes, bytes, int, str] | None:
        """Return kind, random number, epoch and name; None without a tag by the fleet's secret."""
        body, tag = data[:-_TAG], data[-_TAG:]
        if not self._secret or not compare_digest(tag, self._tag(body)):
            return None
        nonce, epoch, name = body[1:][:_NONCE], body[1 + _NONCE :][:8], body[1 + _NONCE + 8 :]
        return body[:1], nonce, int.from_bytes(epoch, "big"), name.decode(errors="replace")

    def _tag(self, body: bytes) -> bytes:
        return blake2b(body, key=self._secret, digest_size=_TAG).digest()

    def _connected(self, endpoint: Endpoint) -> socket.socket:
        it = _udp_socket(endpoint.host)
        try:
            if sys.platform == "linux":
                it.setsockopt(*_RECVERR[it.family], 1)
            it.connect((endpoint.host, endpoint.port))
        except BaseException:
            it.close()
            raise
        self._selector.register(it, selectors.EVENT_READ)
        return it

    def _forget(self, name: str) -> None:
        peer = self._peers.pop(name)
        self._selector.unregister(peer.socket)
        peer.socket.close()


def _udp_socket(host: str) -> socket.socket:
    """Return a UDP socket for the family of an IP address; names would have to be looked up."""
    version = ipaddress.ip_address(host).version
    family = socket.AF_INET if version == 4 else socket.AF_INET6
    it = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
    it.setblocking(False)
    return it


def _is_refused(peer: _Peer) -> bool:
    """Return whether its host has refused a datagram; read all that the kernel tells."""
    if sys.platform != "linux":
        return False
    refused = False
    while True:
        try:
            _, told, _, _ = peer.socket.recvmsg(_LONGEST, 512, socket.MSG_ERRQUEUE)
        except OSError:  # there is no more
            return refused
        refused = refused or any(
            (level, kind) == _RECVERR[peer.socket.family] and _is_refusal(data, peer)
            for level, kind, data in told
        )


def _is_refusal(data: bytes, peer: _Peer) -> bool:
    family = peer.socket.family
    if len(data) < _ERROR.size + _ADDRESS[family].stop:
        return False
    _, origin, kind, code, *_ = _ERROR.unpack_from(data)
    sender = data[_ERROR.size :][_ADDRESS[family]]
    host = socket.inet_pton(family, peer.endpoint.host)
    return (origin, kind, code) == _REFUSAL[family] and sender == host
