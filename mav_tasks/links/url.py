"""Link URLs: ``udpin:host:port`` listens, ``udpout:host:port`` dials."""

import ipaddress
from dataclasses import dataclass

from mav_tasks.errors import InsecureLinkError, LinkUrlError

KINDS = ("udpin", "udpout")
#: known to the design, not in this version
LATER = ("tcpin", "tcp", "serial")


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A parsed link URL."""

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can be on the other end."""
        return is_loopback(self.host)


def parse_url(text: str) -> LinkUrl:
    """Give the parts of a link URL; LinkUrlError says what is wrong with it."""
    kind, _, rest = text.partition(":")
    if kind in LATER:
        raise LinkUrlError(f"link {text!r}: {kind} links are not supported in this version")
    if kind not in KINDS:
        raise LinkUrlError(f"link {text!r}: expected udpin:host:port or udpout:host:port")
    host, port = parse_endpoint(rest, what=f"link {text!r}")
    return LinkUrl(kind, host, port)


def parse_endpoint(text: str, *, what: str) -> tuple[str, int]:
    """Give (host, port) of ``host:port``; LinkUrlError names ``what`` they are for."""
    host, _, port = text.removeprefix("//").rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise LinkUrlError(f"{what}: expected host:port with a port from 1 to 65535")
    return host.strip("[]"), int(port)


def is_loopback(host: str) -> bool:
    """Whether a host is this machine by its loopback interface."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def refuse_insecure(url: LinkUrl) -> None:
    """Raise InsecureLinkError for a link that other machines can reach."""
    if not url.is_loopback:
        raise InsecureLinkError(
            f"link {url} reaches beyond this machine and has no signing key: "
            "anybody there could drive the vehicle; say --insecure if that is meant"
        )
