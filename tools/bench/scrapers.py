"""Evenness of 20 Hz setpoints of one server while its metrics are read: by nobody, one, a crowd.

The kinds take turns in short windows of one run, because other load on the machine changes more
from one run to the next than the scrapers change anything.
"""

import json
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import chain, repeat
from statistics import quantiles
from threading import Event, Thread
from time import monotonic, sleep

from .child import HOST, child, free_port, simulated_rovers, udp_socket
from .scripted import loopback
from .setpoints import start_driving
from .table import Row

ROVERS = (5, 20)
WINDOW = 2.0  # s
ROUNDS = 15  # windows of each kind
SETTLES = 3.0  # s until all rovers drive
CROWD = 50  # scrapers that read again and again
HANGING = 20  # connections that send half a request, and another when closed
#: scrapers, hanging connections, and the pause of a scraper in s, by kind
KINDS = {
    "nobody reads": (0, 0, 0.0),
    "one scraper, twice a second": (1, 0, 0.5),
    f"{CROWD} scrapers and {HANGING} that hang": (CROWD, HANGING, 0.01),
}
REQUEST = b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"


def measure() -> list[Row]:
    """Return a row for each kind of scrapers and number of rovers."""
    return [row for rovers in ROVERS for row in _rows(rovers)]


def _rows(rovers: int) -> Iterator[Row]:
    port, vehicle_port, metrics_port = free_port(), free_port(), free_port()
    options = "--drive", "--times", "--metrics", f"{HOST}:{metrics_port}"
    windows: list[tuple[str, float, float]] = []
    answers = dict.fromkeys(KINDS, 0)
    with (
        simulated_rovers(rovers, vehicle_port),
        udp_socket() as client,
        child("server", str(port), str(vehicle_port), *options, quiet=True) as said,
    ):
        client.connect(loopback(port))
        start_driving(client.send, rovers)
        sleep(SETTLES)
        for kind in chain.from_iterable(repeat(tuple(KINDS), ROUNDS)):
            with _scrapers(metrics_port, *KINDS[kind]) as sizes:
                began = monotonic()
                sleep(WINDOW)
                windows.append((kind, began, monotonic()))
                answers[kind] += len(sizes)
    errors: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for error, at in json.loads(said[-1]):
        for kind, began, ended in windows:
            if began <= at < ended:
                errors[kind].append(error)
    calm = quantiles(errors[next(iter(KINDS))], n=100)
    for kind, found in errors.items():
        cuts = quantiles(found, n=100)
        yield Row(
            f"setpoint interval error, p99, {rovers} rovers, {kind}",
            f"{cuts[98] * 1e3:.2f} ms",
            f"p50 {cuts[49] * 1e3:.3f} ms, {len(found):,} intervals, {answers[kind]:,} answers",
            f"{cuts[98] / calm[98]:.2f}×",
            "",
            None,
        )


@contextmanager
def _scrapers(port: int, readers: int, hanging: int, pause: float) -> Iterator[list[int]]:
    """Let scrapers read for a ``with`` block; gives the sizes of the answers."""
    over = Event()
    sizes: list[int] = []
    sockets: set[socket.socket] = set()

    def talk(request: bytes, pause: float) -> None:
        while not over.wait(pause):
            size = 0
            with suppress(OSError), socket.create_connection((HOST, port), timeout=WINDOW) as sock:
                sockets.add(sock)
                sock.sendall(request)
                while data := sock.recv(65_536):
                    size += len(data)
            if size and request == REQUEST:
                sizes.append(size)

    threads = [Thread(target=talk, args=(REQUEST, pause)) for _ in range(readers)]
    threads += [Thread(target=talk, args=(REQUEST[:-2], 0.01)) for _ in range(hanging)]
    with ExitStack() as started:
        for thread in threads:
            thread.start()
            started.callback(thread.join)
        try:
            yield sizes
        finally:
            over.set()
            for sock in list(sockets):
                with suppress(OSError):
                    sock.shutdown(socket.SHUT_RDWR)
