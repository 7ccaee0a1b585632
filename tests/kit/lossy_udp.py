"""A UDP proxy on loopback that loses datagrams, in both directions."""

import selectors
import socket
from contextlib import suppress
from dataclasses import dataclass
from random import Random
from threading import Thread

LOOPBACK = "127.0.0.1"
MAX_DATAGRAM = 65_536
BUFFER = 1 << 20  # bytes; so that the system does not lose datagrams, too
END_LIMIT = 10.0  # s


@dataclass(slots=True)
class Traffic:
    """Counts of the datagrams in one direction."""

    came: int = 0
    lost: int = 0


class LossyUdp:
    """A proxy between clients and a server; each client has its own endpoint towards the server.

    The random numbers depend on a seed, but their order depends on the machine's timing: a run
    cannot be repeated exactly.
    """

    def __init__(self, server_port: int, *, loss: float = 0.0, seed: int = 0) -> None:
        self.to_server, self.to_clients = Traffic(), Traffic()
        self._server = (LOOPBACK, server_port)
        self._loss, self._random = loss, Random(seed)
        self._selector = selectors.DefaultSelector()
        self._up: dict[tuple[str, int], socket.socket] = {}  # by the client's endpoint
        self._down: dict[socket.socket, tuple[str, int]] = {}
        self._front = self._socket()
        self._is_ending, self._end = socket.socketpair()
        self._selector.register(self._is_ending, selectors.EVENT_READ)
        self._thread = Thread(target=self._run, name="lossy UDP", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"LossyUdp(to server: {self.to_server}, to clients: {self.to_clients})"

    @property
    def port(self) -> int:
        """The port at which clients reach the proxy."""
        return int(self._front.getsockname()[1])

    def close(self) -> None:
        """End."""
        self._end.close()  # the other end of the pair becomes readable
        self._thread.join(END_LIMIT)
        assert not self._thread.is_alive(), "the proxy does not end"
        self._selector.close()
        for each in (self._front, self._is_ending, *self._down):
            each.close()

    def see(self, data: bytes, *, is_for_server: bool) -> None:
        """Hook for subclasses: called with each datagram that arrives."""

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select():
                if key.fileobj is self._is_ending:
                    return
                assert isinstance(key.fileobj, socket.socket)
                with suppress(OSError):  # refused or nobody there: lost, as on any network
                    self._pass_on(key.fileobj)

    def _pass_on(self, source: socket.socket) -> None:
        data, peer = source.recvfrom(MAX_DATAGRAM)
        is_up = source is self._front
        if is_up and peer not in self._up:
            ours = self._up[peer] = self._socket()
            self._down[ours] = peer
        self.see(data, is_for_server=is_up)
        traffic = self.to_server if is_up else self.to_clients
        traffic.came += 1
        if self._random.random() < self._loss:
            traffic.lost += 1
        elif is_up:
            self._up[peer].sendto(data, self._server)
        else:
            self._front.sendto(data, self._down[source])

    def _socket(self) -> socket.socket:
        it = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        it.setblocking(False)
        it.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        it.bind((LOOPBACK, 0))
        self._selector.register(it, selectors.EVENT_READ)
        return it
