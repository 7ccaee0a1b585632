"""Link URLs: ``udpin`` and ``tcpin`` listen, ``udpout`` and ``tcp`` dial, ``serial`` is a line.

``kind:host:port``, and ``serial:/dev/ttyUSB0:57600`` with the baud rate.
"""

import ipaddress
from dataclasses import dataclass

from mav_tasks.errors import InsecureLinkError, LinkUrlError

KINDS = ("udpin", "udpout", "tcpin", "tcp")
SERIAL = "serial"
BAUD_RATES = range(1_200, 12_000_001)
EXPECTED = "expected " + ", ".join(f"{kind}:host:port" for kind in KINDS)
EXPECTED += f" or {SERIAL}:device:baud"


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A parsed link URL of the network."""

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can be on the other end."""
        return is_loopback(self.host)


@dataclass(frozen=True, slots=True)
class SerialUrl:
    """A parsed link URL of a serial line."""

    device: str
    baud: int  # bits per second; a byte takes ten

    def __str__(self) -> str:
        return f"{SERIAL}:{self.device}:{self.baud}"


def parse_url(text: str) -> LinkUrl | SerialUrl:
    """Give the parts of a link URL; LinkUrlError says what is wrong with it."""
    kind, _, rest = text.partition(":")
    if kind == SERIAL:
        return _parse_serial(rest, what=f"link {text!r}")
    if kind not in KINDS:
        raise LinkUrlError(f"link {text!r}: {EXPECTED}")
    host, port = parse_endpoint(rest, what=f"link {text!r}")
    return LinkUrl(kind, host, port)


def parse_endpoint(text: str, *, what: str) -> tuple[str, int]:
    """Give (host, port) of ``host:port``; LinkUrlError names ``what`` they are for."""
    host, _, port = text.removeprefix("//").rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise LinkUrlError(f"{what}: expected host:port with a port from 1 to 65535")
    return host.strip("[]"), int(port)


def _parse_serial(text: str, *, what: str) -> SerialUrl:
    device, _, baud = text.rpartition(":")
    if not device or not baud.isdecimal() or len(baud) > 8 or int(baud) not in BAUD_RATES:
        rates = f"from {BAUD_RATES[0]} to {BAUD_RATES[-1]}"
        raise LinkUrlError(f"{what}: expected {SERIAL}:device:baud with a baud rate {rates}")
    return SerialUrl(device, int(baud))


def is_loopback(host: str) -> bool:
    """Whether a host is this machine by its loopback interface."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def refuse_insecure(url: LinkUrl | SerialUrl) -> None:
    """Raise InsecureLinkError for a link that other machines can reach.

    A serial line is a wire that the operator has chosen: nobody can dial it.
    """
    if isinstance(url, LinkUrl) and not url.is_loopback:
        raise InsecureLinkError(
            f"link {url} reaches beyond this machine and has no signing key: "
            "anybody there could drive the vehicle; say --insecure if that is meant"
        )
