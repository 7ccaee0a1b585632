"""Runs the web process: the client, its live view and the HTTP server on one event loop."""

import asyncio
import secrets
import socket
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address

from mav_tasks.basics.errors import UsageError, reason_of
from mav_tasks.client.aio import Client
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.signing import Key
from mav_tasks.shell import http_connections
from mav_tasks.shell.http_connections import HttpLimits, HttpServer, allow_files, under_load
from mav_tasks.web.application import application
from mav_tasks.web.journal import Journal
from mav_tasks.web.live import Live
from mav_tasks.web.records import Records
from mav_tasks.web.services import Services
from mav_tasks.web.sessions import Sessions
from mav_tasks.web.tiles import Tiles
from mav_tasks.web.users import Users

#: not the address of a script, nor of a ground station
PAGE = Address(243, 190)
TELEMETRY, SELDOM = 10, 1  # Hz, of our own connection and of a user's


@dataclass(frozen=True, slots=True)
class WebOptions:
    """How to run."""

    server: str
    host: str
    port: int
    names: tuple[str, ...]
    ring: RingWatch
    key: Key | None
    journal: Journal | None
    tiles: Tiles | None
    records: Records | None


def listening(options: WebOptions) -> socket.socket:
    """Return the bound socket. Raise UsageError if the address cannot be used."""
    try:
        return http_connections.listening(options.host, options.port)
    except OSError as error:
        where = f"{options.host}:{options.port}"
        raise UsageError(f"--listen {where}: {reason_of(error)}") from error


def is_loopback(host: str) -> bool:
    """Return whether only this machine reaches an address. Raise UsageError if it is no address."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        raise UsageError(f"--listen {host}: expected an IP address and a port") from None


def run(options: WebOptions, bound: socket.socket, *, started: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM. ``started`` gets the page's address."""
    with under_load():
        asyncio.run(_run(options, bound, started))


async def _run(options: WebOptions, bound: socket.socket, started: Callable[[str], None]) -> None:
    limits = allow_files(HttpLimits())
    port = bound.getsockname()[1]
    instance = secrets.token_hex(4)

    def connect(key: Key | None, rate: int = SELDOM) -> Client:
        return Client(options.server, **PAGE._asdict(), key=key, telemetry_rate=rate)

    client = connect(options.key, TELEMETRY)
    client.open()
    try:
        live = Live(client, instance, server=options.server)
        users = Users(
            *(options.ring, client), server=options.server, own_key=options.key, connect=connect
        )
        services = Services(
            client,
            live,
            users,
            Sessions(users),
            instance,
            options.server,
            options.journal,
            options.tiles,
            options.records,
        )
        hosts, behind_tls = _hosts(options, port)
        is_open = is_loopback(options.host) and not options.names
        app = application(services, hosts=hosts, behind_tls=behind_tls, is_open=is_open)
        server = HttpServer(app, limits, on_end=live.hub.end)
        async with asyncio.TaskGroup() as group:
            kept = [group.create_task(each) for each in (live.run(), users.run())]
            serving = group.create_task(server.serve(sockets=[bound]))
            serving.add_done_callback(lambda _serving: [each.cancel() for each in kept])
            started(f"http://{_shown(options.host)}:{port}/")
    finally:
        await client.close()


def _hosts(options: WebOptions, port: int) -> tuple[set[str], set[str]]:
    """Return the accepted values of Host, and those of them that a TLS proxy may serve.

    A name with a port is a proxy's. A name without one is this process's, or that of a proxy at
    the default port, which browsers leave out.
    """
    own = {options.host.lower()}
    proxies = {_shown(name.lower()) for name in options.names}
    own |= {name.lower() for name in options.names if not _has_port(name)}
    if is_loopback(options.host) or options.host in ("0.0.0.0", "::"):
        own |= {"localhost", "127.0.0.1", "::1"}
    shown = {_shown(name) for name in own}
    hosts = {f"{name}:{port}" for name in shown} | (shown if port == 80 else set())
    return hosts | proxies, proxies


def _has_port(name: str) -> bool:
    return name.count(":") == 1 or "]:" in name


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host and "[" not in host and not _has_port(host) else host
