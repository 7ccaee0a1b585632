"""The HTTP server, over real sockets: bad requests, slow and hanging clients, many at once."""

import http.client
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from http import HTTPStatus

import pytest

from mav_tasks.errors import UsageError
from mav_tasks.metrics import http_server
from mav_tasks.metrics.http_server import (
    CONNECTIONS,
    LARGEST_HEAD,
    Answer,
    BadRequest,
    HttpServer,
    checked,
    listening,
)
from tests.kit.processes import free_tcp_ports

LIMIT = 30.0  # s
LARGE = b"x" * 20_000_000  # more than the buffers of both ends


async def small() -> Answer:
    return Answer(HTTPStatus.OK, b"small\n")


async def large() -> Answer:
    return Answer(HTTPStatus.OK, LARGE)


async def broken() -> Answer:
    raise ValueError("a bug")


@pytest.fixture
def port() -> Iterator[int]:
    (number,) = free_tcp_ports(1)
    server = HttpServer(listening(f"127.0.0.1:{number}", what="test"))
    server.start({"/small": small, "/large": large, "/broken": broken})
    yield number
    server.close()
    assert "metrics" not in {thread.name for thread in threading.enumerate()}


def said(port: int, request: bytes) -> bytes:
    """Return all that the server answers to some bytes."""
    with socket.create_connection(("127.0.0.1", port), timeout=LIMIT) as sock:
        sock.sendall(request)
        answer = b""
        while data := sock.recv(65_536):
            answer += data
    return answer


def got(port: int, path: str) -> tuple[int, bytes]:
    """Return the status and body of a GET."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=LIMIT)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body


def test_a_page_is_given_whole(port: int) -> None:
    assert got(port, "/small") == (200, b"small\n")
    assert got(port, "/small?x=1") == (200, b"small\n")
    assert got(port, "/large") == (200, LARGE)


def test_head_has_no_body(port: int) -> None:
    answer = said(port, b"HEAD /small HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 200 OK\r\n")
    assert b"Content-Length: 6\r\n" in answer
    assert answer.endswith(b"\r\n\r\n")


HOST = b"Host: localhost\r\n"


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /nothing HTTP/1.1\r\n" + HOST + b"\r\n", 404),
        (b"POST /small HTTP/1.1\r\n" + HOST + b"Content-Length: 3\r\n\r\nabc", 405),
        (b"GET /small\r\n\r\n", 400),
        (b"GET /small HTTP/2.0\r\n" + HOST + b"\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n", 400),  # somebody tries TLS
        (b"GET /small HTTP/1.1\r\n\r\n", 400),
        (b"GET /small HTTP/1.1\r\n" + HOST + HOST + b"\r\n", 400),
        (b"GET /small HTTP/1.1\r\nHost: rover.example\r\n\r\n", 403),
        (b"GET /" + b"x" * 2 * LARGEST_HEAD + b" HTTP/1.1\r\n" + HOST + b"\r\n", 431),
        (b"GET /small HTTP/1.1\r\nX: " + b"x" * 2 * LARGEST_HEAD + b"\r\n\r\n", 431),
        (b"GET /small HTTP/1.0\r\n\r\n", 200),
    ],
)
def test_a_bad_request_is_answered_with_its_status(port: int, request_: bytes, status: int) -> None:
    assert said(port, request_).startswith(f"HTTP/1.1 {status} ".encode())
    assert got(port, "/small") == (200, b"small\n")


def test_a_bug_in_a_page_is_answered_too(port: int, caplog: pytest.LogCaptureFixture) -> None:
    assert got(port, "/broken") == (500, b"internal error\n")
    assert "metrics: internal error" in caplog.text
    assert got(port, "/small")[0] == 200


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:1", "127.0.0.1", "127.0.0.1:8561", "127.3.2.1", "[::1]:8561"]
)
def test_a_loopback_host_is_served(host: str) -> None:
    head = f"GET /x HTTP/1.1\r\nhOST:{host} \r\n\r\n".encode()
    assert checked(head, is_local=True) == ("GET", "/x")


@pytest.mark.parametrize(
    "host",
    ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "10.0.0.1", "[::2]", ""],
)
def test_another_host_is_refused_on_a_loopback_address_only(host: str) -> None:
    head = f"GET /x HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
    with pytest.raises(BadRequest) as refused:
        checked(head, is_local=True)
    assert refused.value.status is HTTPStatus.FORBIDDEN
    assert checked(head, is_local=False) == ("GET", "/x")


def test_who_hangs_is_closed_and_others_have_their_turn(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_server, "REQUEST_WITHIN", 0.2)
    with ExitStack() as opened:
        for _ in range(2 * CONNECTIONS):
            hanging = opened.enter_context(
                socket.create_connection(("127.0.0.1", port), timeout=LIMIT)
            )
            hanging.sendall(b"GET /small HTTP/1.1\r\n")
        assert got(port, "/small") == (200, b"small\n")
        assert hanging.recv(1) == b""


def test_who_reads_nothing_is_closed(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "ANSWER_WITHIN", 0.2)
    with ExitStack() as opened:
        all_slow = [opened.enter_context(socket.socket()) for _ in range(CONNECTIONS)]
        for slow in all_slow:
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            slow.settimeout(LIMIT)
            slow.connect(("127.0.0.1", port))
            slow.sendall(b"GET /large HTTP/1.1\r\n" + HOST + b"\r\n")
        assert got(port, "/small") == (200, b"small\n")  # once the first of them is closed
        received = 0
        with suppress(ConnectionResetError):
            while data := all_slow[0].recv(65_536):
                received += len(data)
        assert received < len(LARGE)


def test_fifty_at_once_are_all_answered(port: int) -> None:
    with ThreadPoolExecutor(50) as pool:
        answers = list(pool.map(lambda _: got(port, "/small"), range(50)))
    assert answers == [(200, b"small\n")] * 50


def test_an_address_that_cannot_be_opened_is_named() -> None:
    (number,) = free_tcp_ports(1)
    with listening(f"127.0.0.1:{number}", what="metrics"), pytest.raises(UsageError) as refused:
        listening(f"127.0.0.1:{number}", what="metrics")
    assert str(refused.value) == (
        f"metrics: 127.0.0.1:{number} cannot be opened: Address already in use:"
        " end the program that has it (ss -lntup names it), or choose another"
    )
    with pytest.raises(UsageError, match=r"192\.0\.2\.1:80 cannot be opened"):
        listening("192.0.2.1:80", what="metrics")
