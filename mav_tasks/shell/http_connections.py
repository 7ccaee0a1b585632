"""HTTP for who may be hostile: uvicorn with time-outs, a bound on connections, and a bounded log.

uvicorn waits without limit for the first byte, for the end of a request, and for a client that does
not read the answer. Here each connection has a time for each of them. When there are too many, a
new one is accepted all the same, and another one gives way: one without a request, else one whose
client keeps this end waiting, else the oldest; of the address that has the most of that kind.
"""

import asyncio
import gc
import logging
import resource
import signal
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from mav_tasks.basics.crowd import first_of_crowd
from mav_tasks.config.settings import Log
from mav_tasks.shell.logs.setup import log_to_stderr

WAITING = 1024  # connections that are not accepted yet
#: objects until garbage is collected: each request leaves some, which hold its headers; the command
#: line collects so seldom that a flood of requests would take gigabytes
GARBAGE = 1000
GRACE = 1  # s for open requests at the end
FILES = 4096  # descriptors
SPARE_FILES = 100  # descriptors for all but connections
LONGEST_HEAD = 16 * 1024  # bytes
#: accepted in one turn of the loop; asyncio logs a lack of descriptors as often
BACKLOG = 64
#: bytes of an answer that the kernel keeps for a client; it would take megabytes for each
SEND_BUFFER = 128 * 1024
LINGER = struct.pack("ii", 1, 0)  # drop what is unread: else the kernel keeps it for many minutes


@dataclass(frozen=True, slots=True)
class HttpLimits:
    """Limits of the connections of one process."""

    request_within: float = 10.0  # s, without a request that is being answered
    body_within: float = 20.0  # s, for the rest of a request
    read_within: float = 10.0  # s, in which a client must read something of what waits for it
    connections: int = 800


class PatientProtocol(H11Protocol):
    """One connection. ``others``: all connections of the process, the oldest first."""

    def __init__(
        self, limits: HttpLimits, others: "dict[PatientProtocol, None]", **named: Any
    ) -> None:
        super().__init__(**named)
        self._limits = limits
        self._others = others
        self._since = 0.0  # when its request, or the wait for one, began
        self._full_since: float | None = None

    def connection_made(self, transport: Any) -> None:
        """Start the time-outs. If there are too many connections, close one."""
        super().connection_made(transport)
        self._since = self.loop.time()
        held: socket.socket = transport.get_extra_info("socket")
        held.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._look()
        if len(self._others) >= self._limits.connections:
            self._make_room()
        self._others[self] = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._watch.cancel()
        self._others.pop(self, None)
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    @property
    def is_kept_waiting(self) -> bool:
        """Whether its client has not sent all of the request, or does not read the answer."""
        return self._full_since is not None or (self.cycle is not None and self.cycle.more_body)

    def pause_writing(self) -> None:
        """Note that the client does not read."""
        self._full_since = self.loop.time()
        super().pause_writing()

    def resume_writing(self) -> None:
        """Note that it reads again."""
        self._full_since = None
        super().resume_writing()

    def data_received(self, data: bytes) -> None:
        """Receive bytes. Once the headers of a request are complete, the connection is not idle."""
        was = self.cycle
        super().data_received(data)
        if self.cycle is not was:
            self._since = self.loop.time()

    def on_response_complete(self) -> None:
        """Start the time-out for the next request."""
        self._since = self.loop.time()
        super().on_response_complete()

    def _make_room(self) -> None:
        found = list(self._others)
        idle = [each for each in found if each.is_idle]
        waiting = [each for each in found if each.is_kept_waiting]
        first_of_crowd(idle or waiting or found, lambda each: (each.client or ("",))[0])._drop()

    def _drop(self) -> None:
        self._others.pop(self, None)
        if self._full_since is not None:
            held: socket.socket = self.transport.get_extra_info("socket")
            held.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, LINGER)
        self.transport.abort()

    def _look(self) -> None:
        """Close the connection if its client takes too long; else look again later."""
        limits, now = self._limits, self.loop.time()
        is_unread = self._full_since is not None and now - self._full_since >= limits.read_within
        if self.is_idle:
            is_slow = now - self._since >= limits.request_within
        else:
            is_slow = self.cycle.more_body and now - self._since >= limits.body_within
        if is_unread or is_slow:
            self._drop()
        else:
            each = min(limits.request_within, limits.read_within) / 2
            self._watch: asyncio.TimerHandle = self.loop.call_later(each, self._look)


class HttpServer(uvicorn.Server):
    """Serves an ASGI application until SIGINT or SIGTERM; a second one ends it at once.

    ``on_end`` ends what would never end by itself, such as event streams.
    """

    def __init__(
        self, app: Any, limits: HttpLimits, *, on_end: Callable[[], None] = lambda: None
    ) -> None:
        others: dict[PatientProtocol, None] = {}
        super().__init__(
            uvicorn.Config(
                app,
                http=lambda **named: PatientProtocol(limits, others, **named),  # type: ignore[arg-type]
                ws="none",
                log_config=None,
                log_level=logging.WARNING,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                backlog=BACKLOG,
                timeout_keep_alive=30,
                timeout_graceful_shutdown=GRACE,
                h11_max_incomplete_event_size=LONGEST_HEAD,
            )
        )
        self._on_end = on_end

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """End in order on SIGINT and SIGTERM, and at once on the second one."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.handle_exit, number, None)
        yield

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End what never ends by itself, and then the rest."""
        self._on_end()
        await super().shutdown(sockets)


def allow_files(limits: HttpLimits) -> HttpLimits:
    """Allow more descriptors; return the limits for as many connections as there may be then."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        soft = max(soft, min(hard, FILES))
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    most = max(1, min(limits.connections, soft - SPARE_FILES))
    return HttpLimits(limits.request_within, limits.body_within, limits.read_within, most)


def listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens. Raise OSError if the address cannot be used."""
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, port))
        bound.listen(WAITING)
    except OSError:
        bound.close()
        raise
    return bound


@contextmanager
def under_load() -> Iterator[None]:
    """Bound log and memory: a reader of the log that has stopped must not keep a STOP back."""
    gc.set_threshold(GARBAGE)
    with log_to_stderr(Log()):
        yield
