"""Runs the web process: the client, its live view and the HTTP server on one event loop."""

import asyncio
import gc
import logging
import resource
import secrets
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from ipaddress import ip_address

import uvicorn

from mav_tasks.client.aio import Client
from mav_tasks.errors import UsageError
from mav_tasks.key_ring.watch import RingWatch
from mav_tasks.logs.setup import log_to_stderr
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.signing import Key
from mav_tasks.settings import Log
from mav_tasks.web.application import application
from mav_tasks.web.connections import PatientProtocol
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
BACKLOG = 1024  # connections that are not accepted yet
GRACE = 1  # s for open requests at the end
FILES = 4096  # descriptors
LONGEST_HEAD = 16 * 1024  # bytes
#: objects until garbage is collected: each request leaves some, which hold its headers; the command
#: line collects so seldom that a flood of requests would take gigabytes
GARBAGE = 1000


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
    family = socket.AF_INET6 if ":" in options.host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((options.host, options.port))
        bound.listen(BACKLOG)  # before the page's address is shown
    except OSError as error:
        bound.close()
        where = f"{options.host}:{options.port}"
        raise UsageError(f"--listen {where}: {error.strerror or error}") from error
    return bound


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
    gc.set_threshold(GARBAGE)
    with log_to_stderr(Log()):  # a reader of the log that has stopped must not keep a STOP back
        asyncio.run(_run(options, bound, started))


async def _run(options: WebOptions, bound: socket.socket, started: Callable[[str], None]) -> None:
    _allow_files()
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
        server = _Server(app, live)
        async with asyncio.TaskGroup() as group:
            kept = [group.create_task(each) for each in (live.run(), users.run())]
            group.create_task(server.until_ended([bound], kept))
            started(f"http://{_shown(options.host)}:{port}/")
    finally:
        await client.close()


class _Server(uvicorn.Server):
    def __init__(self, app: object, live: Live) -> None:
        super().__init__(
            uvicorn.Config(
                app,  # type: ignore[arg-type]
                http=PatientProtocol,
                ws="none",
                lifespan="off",
                log_config=None,
                log_level=logging.WARNING,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                timeout_keep_alive=30,
                timeout_graceful_shutdown=GRACE,
                h11_max_incomplete_event_size=LONGEST_HEAD,
            )
        )
        self._live = live

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """End in order on SIGINT and SIGTERM, and at once on the second one."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.handle_exit, number, None)
        yield

    async def until_ended(
        self, sockets: list[socket.socket], kept: list[asyncio.Task[None]]
    ) -> None:
        """Serve; then end the view, and the connections of users."""
        try:
            await self.serve(sockets=sockets)
        finally:
            for each in kept:
                each.cancel()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the event streams, which would never end by themselves, and then the rest."""
        self._live.hub.end()
        await super().shutdown(sockets)


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


def _allow_files() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, FILES)), hard))
