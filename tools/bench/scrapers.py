"""Evenness of 20 Hz setpoints while metrics are read: once a second, and by a crowd."""

import json
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from statistics import quantiles
from threading import Event, Thread

from .child import HOST, child, free_port, simulated_rovers, udp_socket
from .scripted import loopback
from .setpoints import drive
from .table import Row

ROVERS = (5, 50)
ROUNDS = 3  # of each kind, in turns
CROWD = 50  # scrapers without a pause
HANGING = 20  # connections that send half a request, and another when closed
#: scrapers, hanging connections and the pause of the scrapers in s, by kind
KINDS = {
    "metrics off": None,
    "metrics on, nobody reads": (0, 0, 0.0),
    "one scraper a second": (1, 0, 1.0),
    f"{CROWD} scrapers without pause, {HANGING} hanging": (CROWD, HANGING, 0.0),
}
REQUEST = b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"
PATIENCE = 5.0  # s


def measure() -> list[Row]:
    """Return a row for each kind of scrapers and number of rovers."""
    return [row for rovers in ROVERS for row in _rows(rovers)]


def _rows(rovers: int) -> Iterator[Row]:
    errors: dict[str, list[float]] = {kind: [] for kind in KINDS}
    answers = dict.fromkeys(KINDS, 0)
    for _ in range(ROUNDS):
        for kind in KINDS:
            found, count = _errors(kind, rovers)
            errors[kind] += found
            answers[kind] += count
    calm = quantiles(errors[next(iter(KINDS))], n=1000)
    for kind, found in errors.items():
        cuts = quantiles(found, n=1000)
        yield Row(
            f"setpoint interval error, p99 (p99.9, most), {rovers} rovers, {kind}",
            f"{cuts[989] * 1e3:.2f} ms ({cuts[998] * 1e3:.2f}, {max(found) * 1e3:.1f})",
            f"p50 {cuts[499] * 1e3:.3f} ms, {len(found):,} intervals, {answers[kind]:,} answers",
            f"{cuts[989] / calm[989]:.2f}×",
            "",
            None,
        )


def _errors(kind: str, rovers: int) -> tuple[list[float], int]:
    port, vehicle_port, asked = free_port(), free_port(), KINDS[kind]
    metrics_port = free_port()
    options = [str(port), str(vehicle_port), "--drive"]
    options += [] if asked is None else ["--metrics", f"{HOST}:{metrics_port}"]
    with (
        simulated_rovers(rovers, vehicle_port),
        udp_socket() as client,
        child("server", *options, quiet=True) as said,
        _scrapers(metrics_port, *(asked or (0, 0, 0.0))) as counted,
    ):
        client.connect(loopback(port))
        drive(client.send, rovers)
    errors: list[float] = json.loads(said[-1])
    return errors, len(counted)


@contextmanager
def _scrapers(port: int, readers: int, hanging: int, pause: float) -> Iterator[list[int]]:
    """Let scrapers read for a ``with`` block; gives the sizes of the answers."""
    over = Event()
    sizes: list[int] = []

    def read() -> None:
        while not over.wait(pause):
            size = _talk(port, REQUEST)
            if size:
                sizes.append(size)

    def hang() -> None:
        while not over.is_set():
            _talk(port, REQUEST[:-2])

    threads = [Thread(target=read) for _ in range(readers)]
    threads += [Thread(target=hang) for _ in range(hanging)]
    with ExitStack() as started:
        started.callback(over.set)
        for thread in threads:
            thread.start()
            started.callback(thread.join)
        started.callback(over.set)  # before the threads are joined
        yield sizes


def _talk(port: int, request: bytes) -> int:
    """Return the size of the answer; 0 if there was none."""
    size = 0
    with suppress(OSError), socket.create_connection((HOST, port), timeout=PATIENCE) as sock:
        sock.sendall(request)
        while data := sock.recv(65_536):
            size += len(data)
    return size
