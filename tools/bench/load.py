"""Load by who has no rights on each thing that listens, and what a STOP to it takes meanwhile.

Each kind of load is bounded in connections and rate. A STOP is an operator's: by MAVLink, each of
another address, so that none is a copy of the one before; or by HTTP, each on a new connection.
"""

import os
import re
import resource
import select
import socket
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from itertools import count
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic, perf_counter, sleep, time
from typing import Any

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.signing import signed, timestamp_at
from tests.kit.processes import free_tcp_ports
from tests.kit.web import add_key, key_in, ring_of

from .driving import from_clients
from .harness import (
    CLI,
    HOST,
    STOP,
    Peer,
    Process,
    Row,
    Rows,
    beside,
    p99,
    process,
    server,
    simulated_rovers,
    stops,
)

SECONDS = 5.0  # of each load
APART = 0.1  # s between STOPs by MAVLink
APART_HTTP = 0.7  # s; one client's STOPs that are closer wait, so that they are no copies
PATIENCE, PATIENCE_HTTP = 2.0, 15.0  # s without an answer: lost
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
#: without sessions
OF_CALL = "MCP-Protocol-Version: 2026-07-28\r\nMCP-Method: tools/call\r\nMCP-Name: stop\r\n"


def http(port: int, path: str, body: bytes = b"", more: str = "", *, method: str = "POST") -> bytes:
    """Return a request to a port of ours, with more lines in its head."""
    head = f"{method} {path} HTTP/1.1\r\nHost: {HOST}:{port}\r\nContent-Length: {len(body)}\r\n"
    head += "Content-Type: application/json\r\nAccept: application/json, text/event-stream\r\n"
    return f"{head}{more}Connection: close\r\n\r\n".encode() + body


def events(port: int) -> bytes:
    """Return a request of the stream that a page reads."""
    return http(port, "/api/v1/events", method="GET")


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
        sleep(0.01)


def repeated(port: int, request: bytes, pause: float = 0.0) -> None:
    """Send a request again and again, each on a connection of its own, and read its answer."""
    while True:
        with suppress(OSError), socket.create_connection((HOST, port), 30) as connection:
            connection.sendall(request)
            while not pause and connection.recv(65536):
                pass
        sleep(pause)


def posted(port: int, request: bytes, at_once: int = 2) -> None:
    """Do so side by side."""
    for _ in range(at_once - 1):
        Thread(target=repeated, args=(port, request)).start()
    repeated(port, request)


def noise(fd: int) -> None:
    """Write 100 kB/s of noise to a line, and read what comes."""
    os.set_blocking(fd, False)
    while True:
        with suppress(BlockingIOError):
            os.write(fd, os.urandom(1000))
            os.read(fd, 65536)
        sleep(0.01)


#: what a kind of load does to a port, and with what
Kinds = dict[str, tuple[Any, ...]]
SILENT: Kinds = {"silent": (held, 1100)}
HALF: Kinds = {**SILENT, "half a request": (held, 1100, b"POST /api/v1/stop HTTP/1.1\r\nHo")}
LINK: Kinds = {
    **SILENT,
    "half a packet": (held, 200, b"\xfd\x09"),
    "whole packets": (held, 1100, b"\xfd\x09" + bytes(19)),  # wrong CRC
    "churn": (repeated, b"\xfd\x09noise", 0.002),
}


def page(port: int) -> Kinds:
    """Return the kinds of load on the page and its API."""
    return {
        **HALF,
        "half a body": (held, 900, http(port, "/api/v1/stop", b"{ ")[:-1]),
        "unread streams": (held, 300, events(port)),
        "large bodies": (posted, http(port, "/api/v1/plans", LARGE)),
        "changes": (posted, http(port, "/api/v1/vehicles/1/tasks", TASK)),
    }


def agents(port: int) -> Kinds:
    """Return the kinds of load on MCP over HTTP."""
    return {
        **HALF,
        "half a call": (held, 900, http(port, "/mcp", b"{ ")[:-1]),
        "sessions": (posted, http(port, "/mcp", SESSION), 4),
    }


def load() -> Rows:
    """STOP → acknowledgement of each thing that listens, under load by who has no rights."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, most[1]), most[1]))
    yield from _links()
    for face, kinds, path, body, more in (
        ("web", page, "/api/v1/stop", b"{}", ""),
        ("mcp", agents, "/mcp", CALL, OF_CALL),
    ):
        with _server() as it, faced(face, it.port) as own:
            dial = partial(socket.create_connection, (HOST, own.port))
            request, words = http(own.port, path, body, more), b"acknowledged|STOP is in force"
            ask = partial(answered, dial, request, words, PATIENCE_HTTP)
            while ask() == inf:
                sleep(0.2)
            yield from _loaded(face, kinds(own.port), own, ask, own.port, APART_HTTP)
    resource.setrlimit(resource.RLIMIT_NOFILE, most)


def _links() -> Rows:
    far, near = os.openpty()
    tty.setraw(near)
    closed, opened, metrics = free_tcp_ports(3)
    with TemporaryDirectory() as name:
        folder = Path(name)
        add_key(folder, "anna", "operator")
        keys = ring_of(folder)
        links = [f"tcpin:{HOST}:{closed}?unsigned=refuse", f"tcpin:{HOST}:{opened}"]
        links.append(f"serial:{os.ttyname(near)}:921600")
        options = [f"--metrics={HOST}:{metrics}", f"--keys={keys}"]
        options += [f"--client={each}" for each in links]
        with _server(*options) as it, Peer(to=it.port) as client:
            by_udp = partial(_stop, partial(nullcontext, client))
            strangers: Kinds = {"strangers": (partial(from_clients, "strangers", 5_000),)}
            yield from _loaded("UDP link", strangers, it, by_udp, it.port)
            yield from _loaded("serial line", {"noise": (noise,)}, it, by_udp, far)
            yield from _loaded("metrics", HALF, it, by_udp, metrics)
            for thing, port, secret in (
                ("TCP link, signed", closed, key_in(keys, "anna").secret),
                ("TCP link, unsigned", opened, b""),
            ):
                dial = partial(socket.create_connection, (HOST, port))
                with dial() as known:
                    stop = partial(_stop, partial(nullcontext, known), secret)
                    yield from _loaded(thing, LINK, it, stop, port)
                yield from _loaded(
                    f"{thing}, new client", LINK, it, partial(_stop, dial, secret), port
                )


def _loaded(
    thing: str,
    kinds: Kinds,
    it: Process,
    stop: Callable[[], float],
    target: int,
    apart: float = APART,
) -> Rows:
    def figures() -> tuple[float, ...]:
        sizes = (
            sum(each.stat().st_size for each in it.output.parent.glob(pattern)) / 1e3
            for pattern in ("*.log", "*sqlite*")
        )
        return it.memory() / 1e6, it.seconds(), *sizes

    for kind, (do, *arguments) in {"no load": (None,), **kinds}.items():
        before, began = figures(), monotonic()
        with beside(do, target, *arguments):
            sleep(1.0)
            times = stops(stop, seconds=SECONDS, apart=apart)
            seconds = monotonic() - began
            memory, *grown = (b - a for a, b in zip(before, figures(), strict=True))
        cpu, log, store = (each / seconds for each in grown)
        note = f"{times.count(inf)} of {len(times)} lost; memory {memory:+.1f} MB,"
        note += f" processor {cpu:.0%}, log {log:.2f} kB/s, store {store:.1f} kB/s"
        what = f"{thing}, {kind}: STOP → ack, p99"
        yield Row(what, p99(times), "ms", goal="≤ 50 ms", note=note)


_NUMBERS = count()


def _stop(dial: Callable[[], Any], secret: bytes = b"") -> float:
    """Return the seconds of a STOP by MAVLink until its acknowledgement comes."""
    number = next(_NUMBERS)
    address = Address(200 + number % 40, 1 + number // 40 % 250)
    packet = Encoder(address).encode(STOP)
    if secret:
        packet = signed(packet, secret, link_id=1, timestamp=timestamp_at(time()))
    to = re.escape(STOP.command.to_bytes(2, "little")), re.escape(bytes(address))
    return answered(dial, packet, b"\xfd.{6}\x4d\0\0%b.{6}%b" % to, PATIENCE)


def answered(dial: Callable[[], Any], request: bytes, answer: bytes, within: float) -> float:
    """Return the seconds of a request until its answer comes; infinity if it does not."""
    came, begin = b"", perf_counter()
    with suppress(OSError), dial() as connection:
        connection.settimeout(within)
        connection.sendall(request)
        while perf_counter() < begin + within and (more := connection.recv(2048)):
            came += more
            if re.search(answer, came, re.DOTALL):
                return perf_counter() - begin
    return inf


@contextmanager
def _server(*options: str) -> Iterator[Process]:
    options = ("--store=tasks.sqlite3", *options)
    with simulated_rovers(1) as rover, server(rover, *options, is_limited=True) as it:
        it.wait_for("rover 1: found")
        sleep(2.0)  # what it asks the rover at first
        yield it


@contextmanager
def faced(face: str, server: int) -> Iterator[Process]:
    """Run the page ("web"), or MCP over HTTP ("mcp"), for a ``with`` block."""
    options = [f"--http={HOST}:0"] if face == "mcp" else ["--store=", f"--listen={HOST}:0"]
    with process(*CLI, face, *options, f"--server=udpout:{HOST}:{server}") as it:
        it.port = int(it.wait_for(rf"(?:page:|use) http://{HOST}:(\d+)")[1])
        yield it
