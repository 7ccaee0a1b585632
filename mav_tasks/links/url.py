"""Link URLs: ``udpin`` and ``tcpin`` listen, ``udpout`` and ``tcp`` dial, ``serial`` is a line.

The form is ``kind:host:port``, or ``serial:/dev/ttyUSB0:57600`` with the baud rate. Options follow
a question mark: ``unsigned=allow`` or ``refuse`` and ``key=NAME`` for signing, and ``local=PORT``
for the local port of ``udpout``.
"""

import ipaddress
from dataclasses import dataclass, field

from mav_tasks.errors import LinkUrlError

KINDS = ("udpin", "udpout", "tcpin", "tcp")
SERIAL = "serial"
BAUD_RATES = range(1_200, 12_000_001)
EXPECTED = "expected " + ", ".join(f"{kind}:host:port" for kind in KINDS)
EXPECTED += f" or {SERIAL}:device:baud"
OPTIONS = "unsigned=allow, unsigned=refuse, key=NAME and local=PORT"
UNSIGNED = {"allow": True, "refuse": False}


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A parsed link URL of UDP or TCP."""

    kind: str
    host: str
    port: int
    #: whether unsigned packets are accepted; None if not given. Options do not affect equality
    unsigned: bool | None = field(default=None, compare=False)
    key: str = field(default="", compare=False)
    #: the local port of a dialling link; None if not given
    local: int | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can be the other end."""
        return is_loopback(self.host)

    @property
    def is_udp(self) -> bool:
        """Whether the link uses UDP."""
        return self.kind.startswith("udp")


@dataclass(frozen=True, slots=True)
class SerialUrl:
    """A parsed link URL of a serial line."""

    device: str
    baud: int  # bits per second; a byte takes ten
    unsigned: bool | None = field(default=None, compare=False)  # as in LinkUrl
    key: str = field(default="", compare=False)

    def __str__(self) -> str:
        return f"{SERIAL}:{self.device}:{self.baud}"


def parse_url(text: str) -> LinkUrl | SerialUrl:
    """Return the parts of a link URL; raise LinkUrlError if it is malformed."""
    where, _, options = text.partition("?")
    unsigned, key, local = _parse_options(options, what=f"link {text!r}")
    kind, _, rest = where.partition(":")
    if local is not None and kind != "udpout":
        raise LinkUrlError(f"link {text!r}: local: only udpout has a local port")
    if kind == SERIAL:
        device, baud = _parse_serial(rest, what=f"link {text!r}")
        return SerialUrl(device, baud, unsigned, key)
    if kind not in KINDS:
        raise LinkUrlError(f"link {text!r}: {EXPECTED}")
    host, port = parse_endpoint(rest, what=f"link {text!r}")
    return LinkUrl(kind, host, port, unsigned, key, local)


def parse_endpoint(text: str, *, what: str) -> tuple[str, int]:
    """Return (host, port) of ``host:port``; raise LinkUrlError, which names ``what``."""
    host, _, port = text.removeprefix("//").rpartition(":")
    host = host.strip("[]")
    if not host or not _is_number(port) or not 0 < int(port) < 65536:
        raise LinkUrlError(f"{what}: expected host:port with a port from 1 to 65535")
    return host, int(port)


def _parse_options(text: str, *, what: str) -> tuple[bool | None, str, int | None]:
    options: dict[str, str] = {}
    for each in text.split("&") if text else ():
        name, _, value = each.partition("=")
        if name in options:
            raise LinkUrlError(f"{what}: {name} is given twice")
        if name not in ("unsigned", "key", "local"):
            raise LinkUrlError(f"{what}: unknown option {name!r}: expected {OPTIONS}")
        if not value or (name == "unsigned" and value not in UNSIGNED):
            raise LinkUrlError(f"{what}: {name}: expected one of {OPTIONS}")
        options[name] = value
    unsigned = UNSIGNED[options["unsigned"]] if "unsigned" in options else None
    local = options.get("local")
    if local is not None and not (_is_number(local) and 0 < int(local) < 65536):
        raise LinkUrlError(f"{what}: local: expected a port from 1 to 65535")
    return unsigned, options.get("key", ""), None if local is None else int(local)


def _parse_serial(text: str, *, what: str) -> tuple[str, int]:
    device, _, baud = text.rpartition(":")
    if not device or not _is_number(baud) or int(baud) not in BAUD_RATES:
        rates = f"from {BAUD_RATES[0]} to {BAUD_RATES[-1]}"
        raise LinkUrlError(f"{what}: expected {SERIAL}:device:baud with a baud rate {rates}")
    return device, int(baud)


def _is_number(text: str) -> bool:
    """Whether the text is a whole number of at most 8 digits, which ``int`` always accepts."""
    return text.isdecimal() and len(text) <= 8


def is_loopback(host: str) -> bool:
    """Whether a host is a loopback address or "localhost"."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
