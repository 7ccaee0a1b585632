"""Load by who has no rights: everybody else gets in, above all with a STOP, and memory is bounded.

``tools/bench/run load`` measures more of it.
"""

import json
import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import pytest

from tests.kit.processes import Process, Stand, process, stand
from tests.kit.web import Web, has_rover, web

pytestmark = pytest.mark.slow

HOST = "127.0.0.1"
APART = 0.8  # s; one client's STOPs that are closer wait, so that they are no copies
JSON = {"content-type": "application/json"}


@pytest.fixture(scope="module", autouse=True)
def descriptors() -> Iterator[None]:
    """Allow this process the connections that it opens."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, before[1]), before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


@contextmanager
def connections(port: int, count: int, request: str = "") -> Iterator[None]:
    """Open so many connections, send the same on each, and never read."""
    with ExitStack() as stack:
        for _ in range(count):
            each = stack.enter_context(socket.create_connection((HOST, port), 10))
            if request:
                each.sendall(request.encode())
        yield


def memory_of(running: Process) -> int:
    """Return the resident memory of a process, kB."""
    status = Path(f"/proc/{running.popen.pid}/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0])


def port_of(url: str) -> int:
    return int(url.split(":")[2].partition("/")[0])


# the page


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    """A server and a rover."""
    with stand(tmp_path_factory.mktemp("load")) as it:
        yield it


@pytest.fixture
def page(running: Stand, tmp_path: Path) -> Iterator[Web]:
    """A web process of its own."""
    with web(tmp_path, running) as it:
        has_rover(it)
        yield it


def stops(it: Web, count: int) -> list[float]:
    """Press STOP so many times; return the seconds until each was acknowledged."""
    took = []
    for _ in range(count):
        began = time.monotonic()
        assert it.post("/stop", {})["phase"] == "acknowledged"
        took.append(time.monotonic() - began)
        time.sleep(APART)
    return took


def test_streams_that_nobody_reads_and_requests_without_end_leave_room(page: Web) -> None:
    port = port_of(page.url)
    host = f"Host: {HOST}:{port}\r\n"
    began = memory_of(page.process)
    with (
        connections(port, 220, f"GET /api/v1/events HTTP/1.1\r\n{host}\r\n"),
        connections(port, 700, f"POST /api/v1/stop HTTP/1.1\r\n{host}"),
        connections(
            port,
            200,
            f"POST /api/v1/stop HTTP/1.1\r\n{host}Content-Type: application/json\r\n"
            "Content-Length: 9\r\n\r\n{",
        ),
    ):
        kind, _, shown = next(page.events())
        assert (kind, [each["vehicle"] for each in shown["vehicles"]]) == ("snapshot", [1])
        assert median(stops(page, 5)) < 1.0
        assert memory_of(page.process) - began < 60_000


LISTS = '{"fileType": "Plan", "mission": [' + "[]," * 250_000 + "1]}"
#: bodies that take long to read, with the status of the answer and the begin of its detail
BODIES = [
    (json.dumps({"name": "a.plan", "text": LISTS}).encode(), 422, "a.plan: "),
    (json.dumps({"text": "QGC WPL 110\n" + "1\n" * 2_900_000}).encode(), 422, "text: more than"),
    (
        b'{"text": "x", "more": [' + b'{"a":1},' * 280_000 + b"1]}",
        422,
        "more: unknown; expected",
    ),
    (json.dumps({"text": "[]," * 1_900_000}).encode(), 413, "the body has more than"),
    (b'{"text": "' + b"\\u0041" * 1_900_000 + b'"}', 422, "text: "),
]


def test_large_bodies_keep_no_stop_back(page: Web) -> None:
    for body, status, words in BODIES:
        said = page.client.post("/api/v1/plans", content=body, headers=JSON)
        assert said.status_code == status
        assert said.json()["detail"].startswith(words)
    with flood(page, [body for body, _, _ in BODIES]):
        time.sleep(0.5)
        took = stops(page, 5)
    assert max(took) < 0.5, took  # it was up to 1.5 s


@contextmanager
def flood(it: Web, bodies: list[bytes]) -> Iterator[None]:
    """Let clients send these bodies again and again for a ``with`` block."""
    is_over = threading.Event()

    port = port_of(it.url)

    def send(body: bytes) -> None:
        head = f"POST /api/v1/plans HTTP/1.1\r\nHost: {HOST}:{port}\r\nContent-Length: {len(body)}"
        request = f"{head}\r\nContent-Type: application/json\r\n\r\n".encode() + body
        with socket.create_connection((HOST, port), 60) as connection:
            while not is_over.is_set():
                connection.sendall(request)
                while not connection.recv(65536).endswith(b"}"):
                    pass

    threads = [threading.Thread(target=send, args=(body,)) for body in bodies]
    for each in threads:
        each.start()
    try:
        yield
    finally:
        is_over.set()
        for each in threads:
            each.join(60)


# agents

INFO = {"name": "a", "version": "1"}
OPENING = {"protocolVersion": "2025-11-25", "capabilities": {}, "clientInfo": INFO}
FOR_AGENTS = {"accept": "application/json, text/event-stream"}


class OldAgent:
    """An agent of a version of the protocol that has sessions."""

    def __init__(self, url: str, http: httpx.Client) -> None:
        self._url, self._http, self._headers = url, http, dict(FOR_AGENTS)
        opened = self.post({"id": 1, "method": "initialize", "params": OPENING})
        assert opened.status_code == 200, opened.text
        self._headers["mcp-session-id"] = opened.headers["mcp-session-id"]

    def post(self, message: dict[str, Any]) -> httpx.Response:
        sent = {"jsonrpc": "2.0"} | message
        return self._http.post(self._url, json=sent, headers=self._headers)

    def stop(self) -> httpx.Response:
        params = {"name": "stop", "arguments": {}}
        return self.post({"id": 2, "method": "tools/call", "params": params})


def test_an_agent_stops_a_rover_whoever_opens_connections_and_sessions(
    running: Stand, tmp_path: Path
) -> None:
    pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")
    server = f"udpout:{HOST}:{running.client_port}"
    options = "mcp", "--http", f"{HOST}:0", "--server", server
    with (
        process("-m", "mav_tasks.cli", *options, folder=tmp_path, name="mcp") as it,
        httpx.Client(timeout=30) as http,
        httpx.Client(timeout=30) as later,
    ):
        url = it.wait_for(r"agents can use (http://\S+)")[1]
        port = port_of(url)
        agent = OldAgent(url, http)
        agent.post({"method": "notifications/initialized"})
        assert "STOP is in force" in agent.stop().text
        before = memory_of(it)
        with connections(port, 1100):
            for _ in range(150):
                OldAgent(url, http)
            began = time.monotonic()
            late = OldAgent(url, later)
            assert "STOP is in force" in late.stop().text
            assert "STOP is in force" in agent.stop().text  # its session is in use: it is kept
            assert time.monotonic() - began < 5.0
        assert memory_of(it) - before < 60_000
        assert len(it.text) < 5_000
        assert it.end() < 5
