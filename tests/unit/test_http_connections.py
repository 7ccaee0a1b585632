"""HTTP connections of hostile clients: each ends in time, and there is room for the next one."""

import asyncio
import socket
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from threading import Thread

import pytest
from starlette.requests import Request
from starlette.responses import PlainTextResponse, StreamingResponse
from starlette.types import Receive, Scope, Send

from mav_tasks.http_connections import HttpLimits, HttpServer, listening

HOST = "127.0.0.1"
LIMITS = HttpLimits(request_within=0.4, body_within=0.4, read_within=0.4, connections=8)


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with the length of the body; /stream never ends, /wait answers after a second."""
    if scope["type"] != "http":
        return

    async def stream() -> AsyncIterator[bytes]:
        while True:
            yield bytes(100_000)
            await asyncio.sleep(0.0)

    request = Request(scope, receive)
    if scope["path"] == "/stream":
        await StreamingResponse(stream())(scope, receive, send)
        return
    if scope["path"] == "/wait":
        await asyncio.sleep(1.0)
    await PlainTextResponse(f"{len(await request.body())} bytes")(scope, receive, send)


@pytest.fixture
def port() -> Iterator[int]:
    """The port of a server with short time-outs."""
    bound = listening(HOST, 0)

    class Server(HttpServer):
        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            yield  # only a main thread has signals

    server = Server(app, LIMITS)
    thread = Thread(target=lambda: asyncio.run(server.serve(sockets=[bound])))
    thread.start()
    yield bound.getsockname()[1]
    server.should_exit = True
    thread.join(10)


def dial(port: int, request: bytes = b"") -> socket.socket:
    made = socket.create_connection((HOST, port), 10)
    made.sendall(request)
    return made


def head(path: str, length: int = 0) -> bytes:
    return f"POST {path} HTTP/1.1\r\nHost: a\r\nContent-Length: {length}\r\n\r\n".encode()


def answer_of(connection: socket.socket) -> bytes:
    """Return the first bytes of an answer, up to its body."""
    connection.settimeout(2.0)
    answer = b""
    while not answer.endswith(b"bytes"):
        more = connection.recv(1000)
        assert more, answer
        answer += more
    return answer


def ends_after(connection: socket.socket, *, reads: bool = True) -> float:
    """Return the seconds until this end learns that the connection has ended."""
    began = time.monotonic()
    while time.monotonic() - began < 5.0:
        try:
            if reads and not connection.recv(65536):
                break
            connection.sendall(b"x")
            time.sleep(0.02)
        except ConnectionError:
            break
    return time.monotonic() - began


@pytest.mark.parametrize(
    "sent",
    [b"", b"GET / HT", head("/", 9), head("/", 9) + b"1234", head("/stream")],
    ids=["silent", "head", "no body", "half a body", "unread answer"],
)
def test_who_keeps_it_waiting_is_closed_in_time(port: int, sent: bytes) -> None:
    with dial(port, sent) as connection:
        if b"/stream" in sent:
            assert ends_after(connection, reads=False) < 3.0
        else:
            connection.settimeout(3.0)
            assert b"200" not in connection.recv(65536)


def test_a_request_that_takes_its_time_is_answered(port: int) -> None:
    with dial(port, head("/wait")) as connection:
        assert answer_of(connection).startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize("sent", [b"", b"GET / HT", head("/", 9), head("/wait"), head("/stream")])
def test_there_is_room_for_one_more_whoever_was_there_before(port: int, sent: bytes) -> None:
    held = [dial(port, sent) for _ in range(3 * LIMITS.connections)]
    with dial(port, head("/", 4) + b"stop") as late:
        assert answer_of(late).endswith(b"4 bytes")
    for each in held:
        each.close()


def test_an_address_with_few_connections_loses_none_to_one_with_many(port: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.2", 0))
        other.connect((HOST, port))
        held = [dial(port) for _ in range(2 * LIMITS.connections)]
        other.sendall(head("/", 4) + b"stop")
        assert answer_of(other).endswith(b"4 bytes")
        for each in held:
            each.close()
