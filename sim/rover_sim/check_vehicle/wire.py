"""Bytes to and from a vehicle: a pymavlink link, opened by the server's link URLs."""

import time
from ipaddress import ip_address
from typing import Any, NamedTuple, Protocol

from pymavlink import mavutil

SERIAL = "serial"
NETWORK = ("udpin", "udpout", "tcp", "tcpin")
READ_SIZE = 4096  # bytes


class BadUrl(Exception):
    """Not a link URL; the message is one line for the user."""


class Wire(Protocol):
    """Source and sink of bytes, with their clock."""

    def now(self) -> float:
        """Return the time of the vehicle's world, s."""
        ...

    def send(self, data: bytes) -> None:
        """Send one packet."""
        ...

    def receive(self, within: float) -> bytes:
        """Return the next bytes; empty if none come within ``within`` seconds."""
        ...


class Url(NamedTuple):
    """A parsed link URL."""

    kind: str
    place: str  # host:port, or the device's path
    baud: int  # of a serial link

    @property
    def is_local(self) -> bool:
        """Whether the other end must be this machine; a serial cable is not local."""
        if self.kind == SERIAL:
            return False
        host = self.place.rpartition(":")[0]
        return host == "localhost" or ip_address(host).is_loopback


def read_url(text: str) -> Url:
    """Parse udpout:host:port, udpin:…, tcp:…, tcpin:… or serial:path:baud. Raise BadUrl."""
    kind, _, rest = text.partition(":")
    place, _, number = rest.rpartition(":")
    if kind not in (*NETWORK, SERIAL) or not place or not number.isdigit():
        raise BadUrl(f"not a link: {text}; udpout:127.0.0.1:14580, serial:/dev/ttyACM0:57600 are")
    if kind == SERIAL:
        return Url(kind, place, int(number))
    try:
        host = "127.0.0.1" if place == "localhost" else str(ip_address(place))
    except ValueError as error:
        raise BadUrl(f"not an IP address: {place}") from error
    if not 0 < int(number) < 65536:
        raise BadUrl(f"not a port: {number}")
    return Url(kind, f"{host}:{number}", 0)


class MavutilWire:
    """A real link. ``speed``: simulated seconds per second, for a rover in faster time."""

    def __init__(self, url: Url, *, speed: float = 1.0) -> None:
        self._speed = speed
        self._link: Any
        if url.kind == SERIAL:
            self._link = mavutil.mavlink_connection(url.place, baud=url.baud)
        else:
            self._link = mavutil.mavlink_connection(f"{url.kind}:{url.place}")

    def __repr__(self) -> str:
        return f"MavutilWire({self._link})"

    def now(self) -> float:
        """Return the monotonic clock, scaled to the vehicle's time."""
        return time.monotonic() * self._speed

    def send(self, data: bytes) -> None:
        """Send one packet."""
        self._link.write(data)

    def receive(self, within: float) -> bytes:
        """Return the next bytes; empty if none come in time."""
        if self._link.select(max(0.0, within / self._speed)):
            return bytes(self._link.recv(READ_SIZE) or b"")
        return b""

    def close(self) -> None:
        """Close the link."""
        self._link.close()
