"""Child process: load by who has no rights: ``KIND PORT``, or ``KIND FD`` for a serial line.

Each kind is bounded in connections and rate, and goes on until SIGTERM.
"""

import json
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress

from .child import HOST, READY

SESSION = {"protocolVersion": "2025-11-25", "capabilities": {}, "clientInfo": {"name": "a"}}
LARGE = b'{"text": "x", "more": [' + b'{"a":1},' * 280_000 + b"1]}"
TASK = b'{"goals": [{"kind": "wait", "duration": 1}], "delay": 5000}'
SESSIONS_AT_ONCE = 4


def _dialled(port: int, request: bytes) -> socket.socket:
    made = socket.create_connection((HOST, port), 5)
    made.setblocking(False)
    with suppress(BlockingIOError):
        made.send(request)
    return made


def _held(port: int, count: int, request: bytes = b"") -> None:
    """Hold so many connections, and never read; open those again that are closed."""
    poll, held = select.poll(), dict[int, socket.socket]()
    _ready()
    while True:
        while len(held) < count:
            with suppress(OSError):
                made = _dialled(port, request)
                held[made.fileno()] = made
                poll.register(made, select.POLLRDHUP)
        for number, _ in poll.poll(10):
            poll.unregister(number)
            held.pop(number).close()
        time.sleep(0.01)


def _churn(port: int, rate: float) -> None:
    """Connect, send noise, and leave again."""
    _ready()
    while True:
        with suppress(OSError):
            _dialled(port, b"\xfd\x09noise").close()
        time.sleep(1 / rate)


def _posted(port: int, path: str, body: bytes, *, method: str = "POST", at_once: int = 1) -> None:
    """Send a request again and again, each on a connection of its own, and read its answer."""
    head = f"{method} {path} HTTP/1.1\r\nHost: {HOST}:{port}\r\nContent-Length: {len(body)}\r\n"
    head += "Content-Type: application/json\r\nAccept: application/json, text/event-stream\r\n"
    request = f"{head}Connection: close\r\n\r\n".encode() + body
    for _ in range(at_once - 1):
        if not os.fork():
            break
    else:
        _ready()
    while True:
        with suppress(OSError), socket.create_connection((HOST, port), 30) as connection:
            connection.sendall(request)
            while connection.recv(65536):
                pass


def _noise(fd: int, rate: int) -> None:
    """Write noise to a line, so many bytes a second, and read what comes."""
    os.set_blocking(fd, False)
    _ready()
    while True:
        with suppress(BlockingIOError):
            os.write(fd, os.urandom(rate // 100))
        with suppress(BlockingIOError):
            os.read(fd, 65536)
        time.sleep(0.01)


def _http(port: int, method: str, path: str, more: str = "") -> bytes:
    return f"{method} {path} HTTP/1.1\r\nHost: {HOST}:{port}\r\n{more}\r\n".encode()


def _ready() -> None:
    print(READY, flush=True)


def _slow_body(port: int, path: str) -> bytes:
    more = "Content-Type: application/json\r\nContent-Length: 9\r\n"
    return _http(port, "POST", path, more) + b"{"


def _opening() -> bytes:
    call = {"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": SESSION}
    call["params"] = SESSION | {"clientInfo": {"name": "a", "version": "1"}}
    return json.dumps(call).encode()


KINDS: dict[str, Callable[[int], None]] = {
    "silent": lambda port: _held(port, 1100),
    "half a packet": lambda port: _held(port, 200, b"\xfd\x09"),
    "whole packets": lambda port: _held(port, 1100, b"\xfd\x09" + bytes(19)),  # wrong CRC
    "half a request": lambda port: _held(port, 1100, b"POST /api/v1/stop HTTP/1.1\r\nHo"),
    "half a body": lambda port: _held(port, 900, _slow_body(port, "/api/v1/stop")),
    "half a call": lambda port: _held(port, 900, _slow_body(port, "/mcp")),
    "churn": lambda port: _churn(port, 500.0),
    "unread streams": lambda port: _held(port, 300, _http(port, "GET", "/api/v1/events")),
    "large bodies": lambda port: _posted(port, "/api/v1/plans", LARGE, at_once=2),
    "changes": lambda port: _posted(port, "/api/v1/vehicles/1/tasks", TASK, at_once=2),
    "sessions": lambda port: _posted(port, "/mcp", _opening(), at_once=SESSIONS_AT_ONCE),
    "noise": lambda fd: _noise(fd, 100_000),
}


def main() -> None:
    """Begin the load, and go on until SIGTERM."""
    signal.signal(signal.SIGTERM, lambda *_: os.killpg(0, signal.SIGKILL))
    os.setpgrp()
    KINDS[sys.argv[1]](int(sys.argv[2]))


if __name__ == "__main__":
    main()
