"""Serves agents by streamable HTTP, on addresses of this machine only.

HTTP here has neither keys nor encryption. So it listens on loopback, and answers only requests
that name this address as their host, from pages of this address if a browser sends them: a page
from elsewhere cannot use a rover through a browser on this machine.
"""

import logging
from collections.abc import Callable
from ipaddress import ip_address
from typing import Any, NamedTuple

from mcp.server.lowlevel import Server
from mcp.server.transport_security import TransportSecuritySettings

from mav_tasks.agents.http_sessions import HttpSessions
from mav_tasks.basics.errors import LinkOpenError, UsageError, reason_of
from mav_tasks.shell.http_connections import (
    HttpLimits,
    HttpServer,
    allow_files,
    listening,
    under_load,
)

PATH = "/mcp"
LOCALHOST = "localhost"
LAST_PORT = 65_535
LONGEST_BODY = 128 * 1024  # bytes, for some 2,000 goals


class Place(NamedTuple):
    """An address of this machine, and a TCP port; 0: a free one."""

    host: str
    port: int

    @property
    def authority(self) -> str:
        """Host and port as URLs have them."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def place_of(text: str) -> Place:
    """Return the place in "HOST:PORT". Raise UsageError if it is invalid, or not loopback."""
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    is_port = port.isascii() and port.isdigit() and int(port) <= LAST_PORT
    if not (colon and host and is_port):
        raise UsageError(f"--http {text}: expected HOST:PORT, for example 127.0.0.1:8765")
    if not _is_loopback(host):
        raise UsageError(
            f"--http {text}: {host} can be reached from other machines, and HTTP has no keys here;"
            " use 127.0.0.1, and for other machines a reverse proxy that checks who they are"
        )
    return Place(host, int(port))


def _is_loopback(host: str) -> bool:
    if host == LOCALHOST:
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


async def serve_http(server: Server[Any], place: Place, tell: Callable[[str], None]) -> None:
    """Serve until a signal ends the process. ``tell`` gets the URL once it is open.

    Raise LinkOpenError if the port is in use.
    """
    limits = allow_files(HttpLimits())
    try:
        bound = listening(place.host, place.port)
    except OSError as error:
        raise LinkOpenError(f"--http {place.authority}: {reason_of(error)}") from error
    place = place._replace(port=bound.getsockname()[1])
    hosts = {place.authority, *(f"{name}:{place.port}" for name in ("127.0.0.1", LOCALHOST))}
    protection = TransportSecuritySettings(
        enable_dns_rebinding_protection=True,
        allowed_hosts=sorted(hosts),
        allowed_origins=sorted(f"http://{host}" for host in hosts),
    )
    app = server.streamable_http_app(
        streamable_http_path=PATH,
        transport_security=protection,
        max_request_body_size=LONGEST_BODY,
    )
    tell(f"http://{place.authority}{PATH}")
    logging.getLogger("mcp").setLevel(logging.WARNING)  # it has a line for each session
    with under_load():
        await HttpServer(HttpSessions(app), limits).serve(sockets=[bound])
