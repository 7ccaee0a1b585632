"""A small HTTP server for metrics and health checks, in a thread of its own.

It answers GET and HEAD, one request per connection. A flood cannot make it busy: it accepts one
connection every ACCEPT_EVERY, serves at most CONNECTIONS at a time, and closes a connection that
sends its request or takes its answer too slowly. The kernel keeps or refuses the others.

Only this machine may read the pages, but not a web page in its browser. That page could use a name
of its own that resolves to a loopback address (DNS rebinding); the browser then sends that name in
the Host header. So on a loopback address the Host must be one, too.
"""

import asyncio
import logging
import socket
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from threading import Thread

from mav_tasks.basics.errors import UsageError, reason_of
from mav_tasks.links.endpoint import is_loopback, parse_endpoint

log = logging.getLogger("mav_tasks")

CONNECTIONS = 8  # served at a time
BACKLOG = 16  # connections that wait in the kernel
ACCEPT_EVERY = 0.01  # s
LARGEST_HEAD = 8_192  # bytes of request line and headers
REQUEST_WITHIN = 3.0  # s, for the whole request
ANSWER_WITHIN = 10.0  # s, to make the answer and to send it
LINGER = 1.0  # s, for the rest of a request that was answered early: closing would reset it
MOST_LINGERED = 65_536  # bytes
END_WITHIN = 1.0  # s
PLAIN = "text/plain; charset=utf-8"


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a request: ``body`` is of the media type ``kind``."""

    status: HTTPStatus
    body: bytes
    kind: str = PLAIN


Page = Callable[[], Awaitable[Answer]]


class BadRequest(Exception):
    """A request that gets no page; the text is for the client."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


def listening(address: str, *, what: str) -> socket.socket:
    """Return a socket that listens at ``host:port``; raise UsageError, which names ``what``."""
    host, port = parse_endpoint(address, what=what)
    try:
        family, _, _, _, found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise UsageError(f"{what}: {address} cannot be opened: {error.strerror}") from error
    try:
        listener.setblocking(False)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(found)
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        raise UsageError(f"{what}: {address} cannot be opened: {reason_of(error)}") from error
    return listener


class HttpServer:
    """Serves pages by path on a listening socket, from ``start`` to ``close``."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._pages: Mapping[str, Page] = {}
        self._is_local = is_loopback(str(listener.getsockname()[0]))
        self._loop: asyncio.AbstractEventLoop | None = None
        self._serving: asyncio.Task[None] | None = None
        self._is_closing = False
        #: answers by status
        self.answers: Counter[int] = Counter()
        self._thread = Thread(target=self._run, name="metrics", daemon=True)

    def __repr__(self) -> str:
        return f"HttpServer({list(self._pages)}, {self.answers.total()} answers)"

    def start(self, pages: Mapping[str, Page]) -> None:
        self._pages = pages
        self._thread.start()

    def close(self) -> None:
        """End the thread; wait at most END_WITHIN."""
        self._is_closing = True  # before the look at the loop, which may be about to begin
        loop, serving = self._loop, self._serving
        if loop is not None and serving is not None:
            with suppress(RuntimeError):  # it has ended by itself
                loop.call_soon_threadsafe(serving.cancel)
        if self._thread.is_alive():
            self._thread.join(END_WITHIN)
        self._listener.close()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception:  # a bug of ours must not stop a rover
            log.exception("metrics: internal error: they are no longer served")

    async def _serve(self) -> None:
        self._serving, self._loop = asyncio.current_task(), asyncio.get_running_loop()
        free = asyncio.Semaphore(CONNECTIONS)
        connections: set[asyncio.Task[None]] = set()
        with suppress(asyncio.CancelledError):
            while not self._is_closing:
                await free.acquire()
                connection = await self._accept(self._loop)
                task = self._loop.create_task(self._converse(connection))
                connections.add(task)
                task.add_done_callback(connections.discard)
                task.add_done_callback(lambda _task: free.release())
                await asyncio.sleep(ACCEPT_EVERY)

    async def _accept(self, loop: asyncio.AbstractEventLoop) -> socket.socket:
        while True:
            try:
                return (await loop.sock_accept(self._listener))[0]
            except OSError:  # it is gone already, or no descriptors are left
                await asyncio.sleep(1.0)

    async def _converse(self, connection: socket.socket) -> None:
        """Serve one connection, and close it."""
        writer: asyncio.StreamWriter | None = None
        try:
            reader, writer = await asyncio.open_connection(sock=connection, limit=LARGEST_HEAD)
            await self._serve_one(reader, writer)
        except (OSError, TimeoutError, asyncio.IncompleteReadError):
            pass  # too slow, or gone
        except Exception:  # a bug of ours: the next request may work
            log.exception("metrics: internal error")
        finally:
            if writer is None:
                connection.close()
            else:
                writer.transport.abort()  # what was sent is sent: see _send

    async def _serve_one(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with_body = True
        try:
            async with asyncio.timeout(REQUEST_WITHIN):
                head = await _head(reader)
            method, path = checked(head, is_local=self._is_local)
            with_body = method == "GET"
            answer = await self._page_at(path)
        except BadRequest as mistake:
            answer = Answer(mistake.status, f"{mistake}\n".encode())
        self.answers[answer.status] += 1
        async with asyncio.timeout(ANSWER_WITHIN):
            await _send(writer, answer, with_body=with_body)
        with suppress(TimeoutError):
            async with asyncio.timeout(LINGER):
                left = MOST_LINGERED
                while left > 0 and (rest := await reader.read(left)):
                    left -= len(rest)

    async def _page_at(self, path: str) -> Answer:
        page = self._pages.get(path)
        if page is None:
            words = f"not here; there are {', '.join(self._pages)}"
            raise BadRequest(HTTPStatus.NOT_FOUND, words)
        try:
            async with asyncio.timeout(ANSWER_WITHIN):
                return await page()
        except TimeoutError:
            words = f"the answer was not ready within {ANSWER_WITHIN:g} s"
            raise BadRequest(HTTPStatus.SERVICE_UNAVAILABLE, words) from None
        except Exception:  # a bug of ours
            log.exception("metrics: internal error")
            raise BadRequest(HTTPStatus.INTERNAL_SERVER_ERROR, "internal error") from None


async def _head(reader: asyncio.StreamReader) -> bytes:
    """Return a request's head; raise BadRequest if it is too long."""
    try:
        return await reader.readuntil(b"\r\n\r\n")
    except asyncio.LimitOverrunError:
        words = f"a request has at most {LARGEST_HEAD} bytes here"
        raise BadRequest(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, words) from None


async def _send(writer: asyncio.StreamWriter, answer: Answer, *, with_body: bool) -> None:
    """Send an answer, and wait until the kernel has all of it."""
    fields = {
        "Content-Type": answer.kind,
        "Content-Length": len(answer.body),
        "Cache-Control": "no-store",
        "X-Content-Type-Options": "nosniff",
        "Connection": "close",
    }
    if answer.status is HTTPStatus.METHOD_NOT_ALLOWED:
        fields["Allow"] = "GET, HEAD"
    lines = [f"HTTP/1.1 {answer.status.value} {answer.status.phrase}"]
    lines += [f"{name}: {value}" for name, value in fields.items()]
    head = "\r\n".join(lines).encode("ascii") + b"\r\n\r\n"
    writer.transport.set_write_buffer_limits(0)  # drain waits for all of it
    writer.write(head + (answer.body if with_body else b""))
    await writer.drain()
    writer.write_eof()


def checked(head: bytes, *, is_local: bool) -> tuple[str, str]:
    """Return the method and the path of a request's head; raise BadRequest if it is invalid."""
    first, *fields = head.decode("latin-1").removesuffix("\r\n\r\n").split("\r\n")
    words = first.split(" ")
    if len(words) != 3 or words[2] not in ("HTTP/1.0", "HTTP/1.1"):
        raise BadRequest(HTTPStatus.BAD_REQUEST, "expected a request of HTTP/1.1")
    method, target, version = words
    pairs = (field.partition(":") for field in fields)
    named = [value.strip() for name, colon, value in pairs if colon and name.lower() == "host"]
    if len(named) > 1 or (not named and version == "HTTP/1.1"):
        raise BadRequest(HTTPStatus.BAD_REQUEST, "expected one Host")
    if is_local and named and not is_loopback(host_in(named[0])):
        raise BadRequest(HTTPStatus.FORBIDDEN, "Host is no loopback address")
    if method not in ("GET", "HEAD"):
        raise BadRequest(HTTPStatus.METHOD_NOT_ALLOWED, "only GET and HEAD")
    return method, target.partition("?")[0]


def host_in(value: str) -> str:
    """Return the host of a Host header, without its port and brackets."""
    if value.startswith("["):
        return value[1:].partition("]")[0]
    return value.partition(":")[0].lower()
