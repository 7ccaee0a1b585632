"""Load by who has no rights on each thing that listens, and what a STOP to it takes meanwhile.

Each kind of load is bounded in connections and rate. A STOP is an operator's: by MAVLink, or by
HTTP, each time on a connection of its own.
"""

import http.client
import math
import os
import re
import resource
import select
import socket
import time
import tty
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.signing import signed, timestamp_at
from tests.kit.processes import free_tcp_ports
from tests.kit.web import add_key, key_in, ring_of

from .floods import from_clients
from .processes import CLI, HOST, Process, beside, process, server, simulated_rovers
from .rows import Row, percentiles
from .wire import STOP, Speaker, effect, stops

SECONDS = 5.0  # of each load
APART = 0.1  # s between STOPs by MAVLink, each of another address
APART_HTTP = 0.7  # s; one client's STOPs that are closer wait, so that they are no copies
PATIENCE = 2.0  # s without an acknowledgement: lost
ACKNOWLEDGED = re.compile(rb"\xfd.{6}\x4d\0\0" + STOP.command.to_bytes(2, "little"), re.DOTALL)
LARGE = b'{"text": "x", "more": [' + b'{"a":1},' * 280_000 + b"1]}"
TASK = b'{"goals": [{"kind": "wait", "duration": 1}], "delay": 5000}'
SESSION = (
    b'{"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"protocolVersion":'
    b' "2025-11-25", "capabilities": {}, "clientInfo": {"name": "a", "version": "1"}}}'
)
CALL = (
    b'{"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": {"name": "stop", "arguments":'
    b' {}, "_meta": {"io.modelcontextprotocol/protocolVersion": "2026-07-28",'
    b' "io.modelcontextprotocol/clientInfo": {"name": "a", "version": "1"},'
    b' "io.modelcontextprotocol/clientCapabilities": {}}}}'
)
JSON = {"content-type": "application/json"}
OF_CALL = {
    "accept": "application/json, text/event-stream",
    "mcp-protocol-version": "2026-07-28",  # without sessions
    "mcp-method": "tools/call",
    "mcp-name": "stop",
}


def http_head(path: str, length: int = 0, method: str = "POST") -> bytes:
    """Return the head of a request."""
    head = f"{method} {path} HTTP/1.1\r\nHost: {HOST}\r\nContent-Length: {length}\r\n"
    head += "Content-Type: application/json\r\nAccept: application/json, text/event-stream\r\n"
    return f"{head}Connection: close\r\n\r\n".encode()


EVENTS = http_head("/api/v1/events", method="GET")


def held(port: int, number: int, request: bytes = b"", is_read: Any = 0) -> None:
    """Hold so many connections; open those again that are closed."""
    poll, opened = select.poll(), dict[int, socket.socket]()
    while True:
        while len(opened) < number:
            with suppress(OSError):
                made = socket.create_connection((HOST, port), 5)
                made.setblocking(False)
                opened[made.fileno()] = made
                poll.register(made, select.POLLRDHUP | select.POLLIN * is_read)
                made.send(request)
        for fd, event in poll.poll(10):
            if event == select.POLLIN:
                opened[fd].recv(1 << 16)
            else:
                poll.unregister(fd)
                opened.pop(fd).close()
        time.sleep(0.01)


def repeated(port: int, request: bytes, pause: float = 0.0, at_once: int = 1) -> None:
    """Send a request again and again, each on a connection of its own, and read its answer."""
    for _ in range(at_once - 1):
        Thread(target=repeated, args=(port, request, pause)).start()
    while True:
        with suppress(OSError), socket.create_connection((HOST, port), 30) as connection:
            connection.sendall(request)
            while not pause and connection.recv(65536):
                pass
        time.sleep(pause)


def posted(path: str, body: bytes, at_once: int = 2) -> tuple[Any, ...]:
    """Return a load of changes."""
    return repeated, http_head(path, len(body)) + body, 0.0, at_once


def noise(fd: int) -> None:
    """Write 100 kB/s of noise to a line, and read what comes."""
    os.set_blocking(fd, False)
    while True:
        with suppress(BlockingIOError):
            os.write(fd, os.urandom(1000))
            os.read(fd, 65536)
        time.sleep(0.01)


SILENT = {"silent": (held, 1100)}
HALF = {"half a request": (held, 1100, b"POST /api/v1/stop HTTP/1.1\r\nHo")}
LINK: dict[str, tuple[Any, ...]] = {
    **SILENT,
    "half a packet": (held, 200, b"\xfd\x09"),
    "whole packets": (held, 1100, b"\xfd\x09" + bytes(19)),  # wrong CRC
    "churn": (repeated, b"\xfd\x09noise", 0.002),
}
PAGE: dict[str, tuple[Any, ...]] = {
    **SILENT,
    **HALF,
    "half a body": (held, 900, http_head("/api/v1/stop", 9) + b"{"),
    "unread streams": (held, 300, EVENTS),
    "large bodies": posted("/api/v1/plans", LARGE),
    "changes": posted("/api/v1/vehicles/1/tasks", TASK),
}
AGENTS: dict[str, tuple[Any, ...]] = {
    **SILENT,
    **HALF,
    "half a call": (held, 900, http_head("/mcp", 9) + b"{"),
    "sessions": posted("/mcp", SESSION, at_once=4),
}
STRANGERS = {"strangers": (partial(from_clients, "strangers", 5_000),)}


def measure(tree: Path) -> Iterator[Row]:
    """STOP → acknowledgement of each thing that listens, under load by who has no rights."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
    yield from _of_links(tree)
    for face, kinds, path, body, headers in (
        ("web", PAGE, "/api/v1/stop", b"{}", {}),
        ("mcp", AGENTS, "/mcp", CALL, OF_CALL),
    ):
        with _server(tree) as it, faced(tree, face, it.port) as (own, port):
            stop = partial(_stop_by_http, f"http://{HOST}:{port}{path}", body, headers)
            while stop() == math.inf:
                time.sleep(0.2)
            yield from _loaded(face, kinds, own, stop, port, APART_HTTP)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def _loaded(
    thing: str,
    kinds: dict[str, tuple[Any, ...]],
    it: Process,
    stop: Callable[[], float],
    target: int,
    apart: float = APART,
) -> Iterator[Row]:
    def figures() -> tuple[float, ...]:
        return it.memory() / 1e6, it.seconds(), it.size("*.log") / 1e3, it.size("*sqlite*") / 1e3

    for kind, (do, *arguments) in {"no load": (None,), **kinds}.items():
        before, began = figures(), time.monotonic()
        with beside(do, target, *arguments) if do else nullcontext():
            time.sleep(1.0)
            times, lost = stops(stop, seconds=SECONDS, apart=apart)
            seconds = time.monotonic() - began
            memory, *grown = (b - a for a, b in zip(before, figures(), strict=True))
        cpu, log, store = (each / seconds for each in grown)
        note = f"{lost} of {lost + len(times)} lost; memory {memory:+.1f} MB,"
        note += f" processor {cpu:.0%}, log {log:.2f} kB/s, store {store:.1f} kB/s"
        p99 = math.inf if lost else percentiles(times).p99
        yield Row(f"{thing}, {kind}: STOP → ack, p99", p99, "ms", goal="≤ 50 ms", note=note)


@contextmanager
def _server(tree: Path, *options: str) -> Iterator[Process]:
    options = ("--store=tasks.sqlite3", *options)
    with simulated_rovers(1) as rover, server(tree, rover, *options, is_limited=True) as it:
        it.wait_for("rover 1: found")
        time.sleep(2.0)  # what it asks the rover at first
        yield it


def _of_links(tree: Path) -> Iterator[Row]:
    far, near = os.openpty()
    tty.setraw(near)
    closed, opened, metrics = free_tcp_ports(3)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        add_key(folder, "anna", "operator")
        key = key_in(ring_of(folder), "anna").secret
        links = [f"tcpin:{HOST}:{closed}?unsigned=refuse", f"tcpin:{HOST}:{opened}"]
        links.append(f"serial:{os.ttyname(near)}:921600")
        options = [f"--metrics={HOST}:{metrics}", f"--keys={ring_of(folder)}"]
        it = stack.enter_context(_server(tree, *(f"--client={each}" for each in links), *options))
        client = stack.enter_context(Speaker(to=it.port))

        def by_udp() -> float:
            client.drain()
            return effect(client, next(_STOPS), m.CommandAck.id, at=client, within=PATIENCE)

        yield from _loaded("UDP link", STRANGERS, it, by_udp, it.port)
        yield from _loaded("serial line", {"noise": (noise,)}, it, by_udp, far)
        yield from _loaded("metrics", {**SILENT, **HALF}, it, by_udp, metrics)
        for name, port, secret in (("signed", closed, key), ("unsigned", opened, b"")):
            dial = partial(socket.create_connection, (HOST, port), PATIENCE)
            with dial() as known:
                stop = partial(_stop_by_tcp, partial(nullcontext, known), secret)
                yield from _loaded(f"TCP link, {name}", LINK, it, stop, port)
            new = partial(_stop_by_tcp, dial, secret)
            yield from _loaded(f"TCP link, {name}, new client", LINK, it, new, port)


#: of other addresses, so that no STOP is a copy of the one before
_STOPS = (
    Encoder(Address(200 + number % 40, 1 + number // 40 % 250)).encode(STOP) for number in count()
)


def _stop_by_tcp(dial: Callable[[], Any], secret: bytes) -> float:
    """Return the seconds of a STOP until its acknowledgement comes; infinity if it does not."""
    packet, came, begin = next(_STOPS), b"", time.perf_counter()
    if secret:
        packet = signed(packet, secret, link_id=1, timestamp=timestamp_at(time.time()))
    with suppress(OSError), dial() as connection:
        connection.sendall(packet)
        while time.perf_counter() < begin + PATIENCE and (more := connection.recv(2048)):
            came = came[-300:] + more
            if ACKNOWLEDGED.search(came):
                return time.perf_counter() - begin
    return math.inf


@contextmanager
def faced(tree: Path, face: str, server: int) -> Iterator[tuple[Process, int]]:
    """Run the page, or MCP over HTTP, for a ``with`` block; yield it, and its port."""
    options = [f"--http={HOST}:0"] if face == "mcp" else ["--store=", f"--listen={HOST}:0"]
    with process(*CLI, face, *options, f"--server=udpout:{HOST}:{server}", tree=tree) as it:
        yield it, int(it.wait_for(rf"(?:page:|use) http://{HOST}:(\d+)")[1])


def asked(url: str, body: bytes | None = None, headers: Mapping[str, str] = JSON) -> bytes:
    """Return the answer to JSON, or to nothing."""
    request = urllib.request.Request(url, body, {**JSON, **headers})
    with urllib.request.urlopen(request, timeout=15) as answer:
        return bytes(answer.read())


def _stop_by_http(url: str, body: bytes, headers: Mapping[str, str]) -> float:
    begin = time.perf_counter()
    with suppress(OSError, http.client.HTTPException):
        if re.search(b"acknowledged|STOP is in force", asked(url, body, headers)):
            return time.perf_counter() - begin
    return math.inf
