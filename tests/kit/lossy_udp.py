"""A UDP proxy on loopback that loses, doubles and reorders what passes, in both directions."""

import heapq
import selectors
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from random import Random
from threading import Thread
from time import monotonic

from mav_tasks.links.memory import Conditions

LOOPBACK = "127.0.0.1"
MOST_CLIENTS = 64  # a datagram of one more is passed over
MOST_UNDER_WAY = 10_000  # datagrams; beyond, they are lost
AT_A_TIME = 64  # datagrams read from one socket before the others have their turn
MAX_DATAGRAM = 65_536
BUFFER = 1 << 20  # bytes; what the system loses, too, would be one thing more to reckon with
END_LIMIT = 10.0  # s


@dataclass(slots=True)
class Traffic:
    """What became of the datagrams of one direction."""

    came: int = 0
    lost: int = 0
    doubled: int = 0
    overtaken: int = 0  # delivered, a copy counting as one, after what had come later


@dataclass(slots=True, eq=False)
class _Way:
    """One direction between one client and the server."""

    sender: socket.socket
    to: tuple[str, int]
    traffic: Traffic
    latest: int = -1  # number of the latest datagram delivered


class LossyUdp:
    """Stands between clients and a server; each client has an endpoint of its own towards it.

    The numbers are random by a seed, but what meets which of them is up to the machine's timing:
    a run is not repeated exactly.
    """

    def __init__(self, server_port: int, conditions: Conditions, *, seed: int) -> None:
        self.to_server, self.to_clients = Traffic(), Traffic()
        self._server = (LOOPBACK, server_port)
        self._conditions = conditions
        self._random = Random(seed)
        self._numbers = count()
        #: a heap of (time of arrival, number, copy, way, data)
        self._under_way: list[tuple[float, int, int, _Way, bytes]] = []
        self._selector = selectors.DefaultSelector()
        self._ways_up: dict[tuple[str, int], _Way] = {}  # by the client's endpoint
        self._ways_down: dict[socket.socket, _Way] = {}  # by the socket that stands for it
        self._front = _udp_socket()
        self._selector.register(self._front, selectors.EVENT_READ)
        self._is_ending, self._end = socket.socketpair()
        self._selector.register(self._is_ending, selectors.EVENT_READ)
        self._thread = Thread(target=self._run, name="lossy UDP", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"LossyUdp(to server: {self.to_server}, to clients: {self.to_clients})"

    @property
    def port(self) -> int:
        """The port at which clients find the server."""
        return int(self._front.getsockname()[1])

    def close(self) -> None:
        """Deliver at once what is still under way, and end."""
        self._end.close()  # is seen at the other end of the pair
        self._thread.join(END_LIMIT)
        assert not self._thread.is_alive(), "the proxy does not end"
        self._selector.close()
        for each in (self._front, self._is_ending, *self._ways_down):
            each.close()

    def see(self, data: bytes, *, is_for_server: bool) -> None:
        """Look at a datagram that has come; a proxy that keeps some does more."""

    def _run(self) -> None:
        is_ending = False
        while not is_ending:
            due = self._under_way[0][0] - monotonic() if self._under_way else None
            for key, _ in self._selector.select(None if due is None else max(due, 0.0)):
                if key.fileobj is self._is_ending:
                    is_ending = True
                elif isinstance(key.fileobj, socket.socket):
                    self._take(key.fileobj)
            self._deliver(monotonic())
        while self._take(self._front):  # what clients had sent before the end was asked for
            pass
        self._deliver(float("inf"))

    def _take(self, source: socket.socket) -> bool:
        """Take in what has come to a socket; False: there was nothing."""
        taken = 0
        with suppress(BlockingIOError, ConnectionRefusedError):  # refused: the server has ended
            while taken < AT_A_TIME:
                data, peer = source.recvfrom(MAX_DATAGRAM)
                taken += 1
                way = self._way_up(peer) if source is self._front else self._ways_down[source]
                if way is not None:
                    self._put_under_way(way, data)
        return taken > 0

    def _way_up(self, client: tuple[str, int]) -> _Way | None:
        way = self._ways_up.get(client)
        if way is None and len(self._ways_up) < MOST_CLIENTS:
            sock = _udp_socket()
            sock.connect(self._server)  # hears nobody else
            self._selector.register(sock, selectors.EVENT_READ)
            way = self._ways_up[client] = _Way(sock, self._server, self.to_server)
            self._ways_down[sock] = _Way(self._front, client, self.to_clients)
        return way

    def _put_under_way(self, way: _Way, data: bytes) -> None:
        """As the virtual net of the scenarios does it."""
        self.see(data, is_for_server=way.traffic is self.to_server)
        how, number, traffic = self._conditions, next(self._numbers), way.traffic
        traffic.came += 1
        if self._random.random() < how.loss or len(self._under_way) >= MOST_UNDER_WAY:
            traffic.lost += 1
            return
        is_double = self._random.random() < how.duplication
        traffic.doubled += is_double
        for copy in range(1 + is_double):
            at = monotonic() + how.delay + self._random.random() * how.jitter
            heapq.heappush(self._under_way, (at, number, copy, way, data))

    def _deliver(self, now: float) -> None:
        while self._under_way and self._under_way[0][0] <= now:
            _, number, _, way, data = heapq.heappop(self._under_way)
            way.traffic.overtaken += number < way.latest
            way.latest = max(way.latest, number)
            with suppress(OSError):  # not taken, or nobody is there: lost as on any network
                if way.sender is self._front:
                    way.sender.sendto(data, way.to)
                else:
                    way.sender.send(data)


def _udp_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    sock.bind((LOOPBACK, 0))
    return sock


@contextmanager
def lossy_udp(server_port: int, conditions: Conditions, *, seed: int) -> Iterator[LossyUdp]:
    """Run a proxy while the block runs; what is under way at its end is delivered at once."""
    with closing(LossyUdp(server_port, conditions, seed=seed)) as proxy:
        yield proxy
