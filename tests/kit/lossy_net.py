"""A bad net between real sockets: it loses, doubles and reorders datagrams, both ways, by a seed.

Each client that calls has a socket of its own towards the server, so that the server sees as many
endpoints as there are clients.
"""

import heapq
import selectors
import socket
import threading
import time
from random import Random
from types import TracebackType

HOST = "127.0.0.1"
LATEST = 0.06  # s that a datagram is on its way at most; what is sent meanwhile may overtake it
MOST = 10_000  # datagrams on their way


class LossyNet:
    """Runs in a thread of its own while the block runs; ``port`` is where clients call."""

    def __init__(self, server_port: int, *, loss: float, doubling: float, seed: int) -> None:
        self._server = (HOST, server_port)
        self._loss, self._doubling = loss, doubling
        self._random = Random(seed)
        self._selector = selectors.DefaultSelector()
        self._inner = _udp_socket()
        self._inner.bind((HOST, 0))
        self.port = int(self._inner.getsockname()[1])
        self._selector.register(self._inner, selectors.EVENT_READ)
        self._outer: dict[tuple[str, int], socket.socket] = {}
        self._callers: dict[socket.socket, tuple[str, int]] = {}
        self._on_way: list[tuple[float, int, socket.socket, tuple[str, int], bytes]] = []
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lossy net")
        self.lost = self.doubled = self.passed = 0

    def __enter__(self) -> "LossyNet":
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._is_over.set()
        self._thread.join(5)
        for each in (self._inner, *self._outer.values()):
            each.close()
        self._selector.close()

    def _run(self) -> None:
        while not self._is_over.is_set():
            due = self._on_way[0][0] - time.monotonic() if self._on_way else 0.05
            for key, _ in self._selector.select(max(0.0, min(due, 0.05))):
                assert isinstance(key.fileobj, socket.socket)
                self._take_all(key.fileobj)
            self._deliver(time.monotonic())

    def _take_all(self, sock: socket.socket) -> None:
        while True:
            try:
                data, peer = sock.recvfrom(2048)
            except BlockingIOError:
                return
            if sock is self._inner:
                self._send(self._outer_of(peer), self._server, data)
            else:
                self._send(self._inner, self._callers[sock], data)

    def _outer_of(self, caller: tuple[str, int]) -> socket.socket:
        if caller not in self._outer:
            sock = self._outer[caller] = _udp_socket()
            self._callers[sock] = caller
            self._selector.register(sock, selectors.EVENT_READ)
        return self._outer[caller]

    def _send(self, sock: socket.socket, to: tuple[str, int], data: bytes) -> None:
        if self._random.random() < self._loss or len(self._on_way) > MOST:
            self.lost += 1
            return
        copies = 2 if self._random.random() < self._doubling else 1
        self.doubled += copies - 1
        for _ in range(copies):
            self.passed += 1
            at = time.monotonic() + self._random.uniform(0.0, LATEST)
            heapq.heappush(self._on_way, (at, self.passed, sock, to, data))

    def _deliver(self, now: float) -> None:
        while self._on_way and self._on_way[0][0] <= now:
            _, _, sock, to, data = heapq.heappop(self._on_way)
            try:
                sock.sendto(data, to)
            except (BlockingIOError, ConnectionRefusedError):
                self.lost += 1


def _udp_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    return sock
