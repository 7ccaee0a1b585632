"""``host:port``: the URLs of links between hosts."""

import ipaddress
from dataclasses import dataclass, field
from typing import ClassVar

from mav_tasks.basics.errors import LinkUrlError
from mav_tasks.links.url import NO_OPTIONS, UrlOptions

PORTS = range(1, 65_536)


@dataclass(frozen=True, slots=True)
class HostUrl:
    """A link URL of the form ``kind:host:port``; each kind has its own ``open``."""

    can_push: ClassVar[bool] = False  # a connection needs somebody who dials

    kind: str
    host: str
    port: int
    options: UrlOptions = field(default=NO_OPTIONS, compare=False)

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"

    @property
    def is_nearby(self) -> bool:
        """Whether only this machine can be the other end."""
        return is_loopback(self.host)


def parse_endpoint(text: str, *, what: str) -> tuple[str, int]:
    """Return (host, port) of ``host:port``; raise LinkUrlError, which names ``what``."""
    host, _, port = text.removeprefix("//").rpartition(":")
    host = host.strip("[]")
    if not host or number_in(port, PORTS) is None:
        raise LinkUrlError(f"{what}: expected host:port with a port from 1 to 65535")
    try:
        host.encode("idna")  # as the system's look-up of names does
    except UnicodeError:
        raise LinkUrlError(f"{what}: no host has such a name") from None
    if not host.isprintable():
        raise LinkUrlError(f"{what}: no host has such a name")
    return host, int(port)


def number_in(text: str, numbers: range) -> int | None:
    """Return the whole number that a text shows, or None if it is not one of ``numbers``."""
    if not text.isdecimal() or len(text) > 8:  # ``int`` refuses more than 4300 digits
        return None
    return int(text) if int(text) in numbers else None


def is_loopback(host: str) -> bool:
    """Whether a host is a loopback address or "localhost"."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
