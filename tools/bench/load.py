"""Load by who has no rights, for each listening thing: its cost, and what a STOP takes meanwhile.

Real processes on loopback: a server with all kinds of links, the page, MCP over HTTP. Each load
lasts some seconds. An operator's STOP goes to the thing that is under load: by MAVLink to the
server's links, by HTTP to the page and to MCP, each time on a connection of its own.
"""

import http.client
import json
import os
import re
import resource
import socket
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from statistics import median, quantiles

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.signing import signed, timestamp_at

from .child import END_WITHIN, HOST, ROOT, SERVER_FROM, child, free_port, simulated_rovers
from .scripted import loopback
from .table import Row

SECONDS = 6.0  # of each load
SETTLES = 1.5  # s, from the begin of a load to its first STOP
APART = 0.1  # s between STOPs by MAVLink, each of another address
APART_HTTP = 0.7  # s; one client's STOPs that are closer wait, so that they are no copies
PATIENCE = 2.0  # s without an acknowledgement: lost
GOAL = 0.05  # s
SECRET = b"an operator's key of 32 bytes: ."
STRANGERS = 5_000  # datagrams/s
TICKS = os.sysconf("SC_CLK_TCK")
LINKS = ("silent", "half a packet", "whole packets", "churn")
PAGES = ("silent", "half a request", "half a body", "unread streams", "large bodies", "changes")
AGENTS = ("silent", "half a request", "half a call", "sessions")
STOP_CALL = {"name": "stop", "arguments": {}}
VERSION = "2026-07-28"  # of MCP, without sessions


@dataclass(slots=True)
class Running:
    """A process of ours: its log, and the folder of its store."""

    pid: int
    log: Path
    store: Path | None = None

    def figures(self) -> tuple[float, float, float, float]:
        """Return memory in kB, processor time in s, log and store in kB."""
        pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        times = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        stored = 0 if self.store is None else sum(_size(each) for each in self.store.iterdir())
        return (
            pages * os.sysconf("SC_PAGE_SIZE") / 1024,
            (int(times[11]) + int(times[12])) / TICKS,
            _size(self.log) / 1024,
            stored / 1024,
        )


Stop = Callable[[], float | None]  # returns the seconds until it was acknowledged; None: lost


def measure() -> list[Row]:
    """Return the rows of every thing under every load."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
    try:
        return [*_of_server(), *_of_page(), *_of_agents()]
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def _rows(thing: str, kind: str, it: Running, stop: Stop, target: int, apart: float) -> list[Row]:
    fds = (target,) if kind == "noise" else ()
    load: AbstractContextManager[object]
    if not kind:
        load = nullcontext()
    elif kind == "strangers":
        load = child("client_flood", str(target), kind, str(STRANGERS))
    else:
        load = child("load_child", kind, str(target), pass_fds=fds)
    print(f"load: {thing}, {kind or 'no load'}", file=sys.stderr, flush=True)
    times, lost = list[float](), 0
    before = it.figures()
    began = time.monotonic()
    with load:
        time.sleep(SETTLES)
        while time.monotonic() - began < SECONDS:
            took = stop()
            if took is None:
                lost += 1
            else:
                times.append(took)
            time.sleep(apart)
        after = it.figures()
        seconds = time.monotonic() - began
    memory, cpu, log, store = (b - a for a, b in zip(before, after, strict=True))
    what = f"{thing}, {kind or 'no load'}"
    p99 = quantiles(times, n=100)[98] if len(times) > 1 else PATIENCE
    shown = f"{p99 * 1e3:.1f} ms, p50 {median(times or [PATIENCE]) * 1e3:.1f} ms"
    met = p99 < GOAL and not lost
    tried = len(times) + lost
    return [
        Row(f"{what}: STOP → ack, p99", f"{shown}, {lost} of {tried} lost", "", "", "< 50 ms", met),
        Row(f"{what}: memory grown", f"{memory / 1024:.1f} MB", "", "", "", None),
        Row(f"{what}: processor", f"{100 * cpu / seconds:.0f} %", "", "", "", None),
        Row(f"{what}: log", f"{log / seconds:.2f} kB/s", "", "", "", None),
        Row(f"{what}: store", f"{store / seconds:.1f} kB/s", "", "", "", None),
    ]


def _of_server() -> Iterator[Row]:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        ring = folder / "keys.toml"
        given = ["keys", "add", "anna", "--role", "operator", "--hex", "--keys", str(ring)]
        _run(*given, given=f"{SECRET.hex()}\n")
        far, near = os.openpty()
        tty.setraw(near)
        udp = free_port()
        signed_tcp, open_tcp, metrics = _free_tcp_ports(3)
        it = stack.enter_context(
            _server(
                folder,
                *("--client", f"udpin:{HOST}:{udp}"),
                *("--client", f"tcpin:{HOST}:{signed_tcp}?unsigned=refuse"),
                *("--client", f"tcpin:{HOST}:{open_tcp}"),
                *("--client", f"serial:{os.ttyname(near)}:921600"),
                *("--metrics", f"{HOST}:{metrics}", "--keys", str(ring)),
            )
        )
        by_udp = stack.enter_context(_stops_by_udp(udp))
        for kind in ("", "strangers"):
            yield from _rows("UDP link", kind, it, by_udp, udp, APART)
        for name, port, secret in (("signed", signed_tcp, SECRET), ("unsigned", open_tcp, None)):
            for kind in LINKS:
                with _stops_by_tcp(port, secret) as stop:
                    yield from _rows(f"TCP link, {name}", kind, it, stop, port, APART)
                stop = _stop_by_new_tcp(port, secret)
                yield from _rows(f"TCP link, {name}, new client", kind, it, stop, port, APART)
        yield from _rows("serial line", "noise", it, by_udp, far, APART)
        for kind in ("silent", "half a request"):
            yield from _rows("metrics", kind, it, by_udp, metrics, APART)


def _of_page() -> Iterator[Row]:
    with _stand() as (folder, udp):
        command = ["web", "--store", "", "--listen", f"{HOST}:0"]
        command += ["--server", f"udpout:{HOST}:{udp}"]
        with _started(folder, "web", *command, ready=r"web page: http://[^:]+:(\d+)") as (it, at):
            port = int(at)
            stop = _stop_by_http(port)
            while stop() is None:
                time.sleep(0.2)
            for kind in ("", *PAGES):
                yield from _rows("page", kind, it, stop, port, APART_HTTP)


def _of_agents() -> Iterator[Row]:
    with _stand() as (folder, udp):
        command = ["mcp", "--http", f"{HOST}:0", "--server", f"udpout:{HOST}:{udp}"]
        with _started(folder, "mcp", *command, ready=r"use http://[^:]+:(\d+)") as (it, at):
            port = int(at)
            stop = _stop_by_mcp(port)
            while stop() is None:
                time.sleep(0.2)
            for kind in ("", *AGENTS):
                yield from _rows("MCP", kind, it, stop, port, APART_HTTP)


@contextmanager
def _stand() -> Iterator[tuple[Path, int]]:
    """Run a server for a ``with`` block; yield its folder and the port of its clients."""
    udp = free_port()
    with (
        tempfile.TemporaryDirectory() as folder,
        _server(Path(folder), "--client", f"udpin:{HOST}:{udp}"),
    ):
        yield Path(folder), udp


@contextmanager
def _server(folder: Path, *options: str) -> Iterator[Running]:
    vehicle = free_port()
    store = folder / "store"
    store.mkdir()
    command = ["serve", "--no-push", "--vehicle", f"udpout:{HOST}:{vehicle}", *options]
    command += ["--store", str(store / "tasks.sqlite3")]
    with (
        simulated_rovers(1, vehicle),
        _started(folder, "server", *command, ready=r"rover (\d+): found") as (it, _),
    ):
        it.store = store
        time.sleep(2.0)  # what it asks the rover at first
        yield it


@contextmanager
def _started(folder: Path, name: str, *command: str, ready: str) -> Iterator[tuple[Running, str]]:
    """Run a command for a ``with`` block; yield it, and what it said once it was ready."""
    log = folder / f"{name}.log"
    environment = os.environ | {"XDG_CONFIG_HOME": str(folder), "XDG_STATE_HOME": str(folder)}
    environment.pop(SERVER_FROM, None)  # no setting of a server
    with log.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "mav_tasks.cli", *command],
            cwd=os.environ.get(SERVER_FROM, ROOT),
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        while not (found := re.search(ready, log.read_text())):
            if process.poll() is not None:
                raise RuntimeError(log.read_text())
            time.sleep(0.05)
        yield Running(process.pid, log), found[1]
    finally:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(END_WITHIN)
        process.kill()


def _run(*command: str, given: str) -> None:
    words = [sys.executable, "-m", "mav_tasks.cli", *command]
    subprocess.run(words, cwd=ROOT, input=given, text=True, check=True, capture_output=True)


def _free_tcp_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        made = [stack.enter_context(socket.create_server((HOST, 0))) for _ in range(count)]
        return [each.getsockname()[1] for each in made]


# STOP


def _senders() -> Iterator[Encoder]:
    """Yield encoders of other addresses, so that no STOP is a copy of the one before."""
    for number in count():
        yield Encoder(Address(200 + number % 40, 1 + number // 40 % 250))


def _acknowledged(read: Callable[[], bytes], began: float) -> float | None:
    """Return the seconds until the acknowledgement of a STOP comes; None if it does not come."""
    waited = b""
    number = int(MavCmd.TASK_STOP).to_bytes(2, "little")
    while time.perf_counter() - began < PATIENCE:
        try:
            more = read()
        except OSError:
            return None
        if not more:
            return None
        waited = waited[-300:] + more
        if re.search(rb"\xfd.{6}\x4d\0\0" + re.escape(number), waited, re.DOTALL):
            return time.perf_counter() - began
    return None


STOP = m.CommandLong(1, 191, MavCmd.TASK_STOP, 0, 0, 0, 0, 0, 0, 0, 0)


@contextmanager
def _stops_by_udp(port: int) -> Iterator[Stop]:
    senders = _senders()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(loopback(port))
        sock.settimeout(PATIENCE)

        def stop() -> float | None:
            sock.settimeout(0.0)
            with suppress(OSError):
                while sock.recv(2048):
                    pass
            sock.settimeout(PATIENCE)
            began = time.perf_counter()
            sock.send(next(senders).encode(STOP))
            return _acknowledged(lambda: sock.recv(2048), began)

        yield stop


@contextmanager
def _stops_by_tcp(port: int, secret: bytes | None) -> Iterator[Stop]:
    """Stop on a connection that was there before the load."""
    senders = _senders()
    with socket.create_connection((HOST, port), PATIENCE) as connection:

        def stop() -> float | None:
            connection.settimeout(0.0)
            with suppress(OSError):
                while connection.recv(65536):
                    pass
            connection.settimeout(PATIENCE)
            return _stop_on(connection, senders, secret, time.perf_counter())

        stop()
        yield stop


def _stop_by_new_tcp(port: int, secret: bytes | None) -> Stop:
    senders = _senders()

    def stop() -> float | None:
        began = time.perf_counter()
        try:
            with socket.create_connection((HOST, port), PATIENCE) as connection:
                return _stop_on(connection, senders, secret, began)
        except OSError:
            return None

    return stop


def _stop_on(
    connection: socket.socket, senders: Iterator[Encoder], secret: bytes | None, began: float
) -> float | None:
    packet = next(senders).encode(STOP)
    if secret is not None:
        packet = signed(packet, secret, link_id=1, timestamp=timestamp_at(time.time()))
    try:
        connection.sendall(packet)
    except OSError:
        return None
    return _acknowledged(lambda: connection.recv(2048), began)


def _asked(port: int, path: str, body: object, **headers: str) -> bytes:
    connection = http.client.HTTPConnection(HOST, port, timeout=PATIENCE)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    named |= {"content-type": "application/json"}
    try:
        connection.request("POST", path, json.dumps(body), named)
        return connection.getresponse().read()
    finally:
        connection.close()


def _timed(ask: Callable[[], bytes]) -> Stop:
    def stop() -> float | None:
        began = time.perf_counter()
        try:
            is_done = re.search(b"acknowledged|STOP is in force", ask())
        except (OSError, http.client.HTTPException):
            return None
        return time.perf_counter() - began if is_done else None

    return stop


def _stop_by_http(port: int) -> Stop:
    return _timed(lambda: _asked(port, "/api/v1/stop", {}))


def _stop_by_mcp(port: int) -> Stop:
    meta = {
        "io.modelcontextprotocol/protocolVersion": VERSION,
        "io.modelcontextprotocol/clientInfo": {"name": "a", "version": "1"},
        "io.modelcontextprotocol/clientCapabilities": {},
    }
    call = {"jsonrpc": "2.0", "id": 1, "method": "tools/call"}
    call |= {"params": STOP_CALL | {"_meta": meta}}
    named = {
        "accept": "application/json, text/event-stream",
        "mcp_protocol_version": VERSION,
        "mcp_method": "tools/call",
        "mcp_name": "stop",
    }
    return _timed(lambda: _asked(port, "/mcp", call, **named))


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
