"""A UDP proxy on loopback that loses, duplicates and reorders datagrams, in both directions."""

import heapq
import selectors
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from random import Random
from threading import Thread
from time import monotonic, time

from mav_tasks.links import stamps
from mav_tasks.links.memory import Conditions

LOOPBACK = "127.0.0.1"
MOST_CLIENTS = 64  # datagrams of further clients are ignored
MOST_UNDER_WAY = 10_000  # datagrams; excess ones are lost
AT_A_TIME = 64  # datagrams per socket before the others have their turn
MAX_DATAGRAM = 65_536
BUFFER = 1 << 20  # bytes; so that the system does not lose datagrams, too
END_LIMIT = 10.0  # s


@dataclass(slots=True)
class Traffic:
    """Counts of the datagrams in one direction."""

    came: int = 0
    lost: int = 0
    doubled: int = 0
    overtaken: int = 0  # delivered after a later one; a copy counts separately


@dataclass(slots=True, eq=False)
class _Way:
    """One direction between one client and the server."""

    sender: socket.socket
    to: tuple[str, int]
    traffic: Traffic
    latest: int = -1  # number of the latest datagram delivered


class LossyUdp:
    """A proxy between clients and a server; each client has its own endpoint towards the server.

    The random numbers depend on a seed, but their order depends on the machine's timing: a run
    cannot be repeated exactly.
    """

    def __init__(self, server_port: int, conditions: Conditions, *, seed: int) -> None:
        self.to_server, self.to_clients = Traffic(), Traffic()
        #: when the system received the latest datagram, in UTC s: not later if this process waits
        self.arrived_at = 0.0
        self._server = (LOOPBACK, server_port)
        self._conditions = conditions
        self._random = Random(seed)
        self._numbers = count()
        #: a heap of (time of arrival, number, copy, way, data)
        self._under_way: list[tuple[float, int, int, _Way, bytes]] = []
        self._selector = selectors.DefaultSelector()
        self._ways_up: dict[tuple[str, int], _Way] = {}  # by the client's endpoint
        self._ways_down: dict[socket.socket, _Way] = {}  # by the socket that represents it
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
        """The port at which clients reach the proxy."""
        return int(self._front.getsockname()[1])

    def close(self) -> None:
        """Deliver pending datagrams at once, and end."""
        self._end.close()  # the other end of the pair becomes readable
        self._thread.join(END_LIMIT)
        assert not self._thread.is_alive(), "the proxy does not end"
        self._selector.close()
        for each in (self._front, self._is_ending, *self._ways_down):
            each.close()

    def see(self, data: bytes, *, is_for_server: bool) -> None:
        """Hook for subclasses: called with each datagram that arrives."""

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
        while self._take(self._front):  # datagrams that clients sent before the end
            pass
        self._deliver(float("inf"))

    def _take(self, source: socket.socket) -> bool:
        """Read datagrams of a socket; return whether there were any."""
        taken = 0
        with suppress(BlockingIOError, ConnectionRefusedError):  # refused: the server has ended
            while taken < AT_A_TIME:
                data, control, _, peer = source.recvmsg(MAX_DATAGRAM, stamps.ROOM)
                taken += 1
                self.arrived_at = stamps.stamp_in(control) or time()
                way = self._way_up(peer) if source is self._front else self._ways_down[source]
                if way is not None:
                    self._put_under_way(way, data)
        return taken > 0

    def _way_up(self, client: tuple[str, int]) -> _Way | None:
        way = self._ways_up.get(client)
        if way is None and len(self._ways_up) < MOST_CLIENTS:
            sock = _udp_socket()
            sock.connect(self._server)  # receives from the server only
            self._selector.register(sock, selectors.EVENT_READ)
            way = self._ways_up[client] = _Way(sock, self._server, self.to_server)
            self._ways_down[sock] = _Way(self._front, client, self.to_clients)
        return way

    def _put_under_way(self, way: _Way, data: bytes) -> None:
        """Apply the conditions like the virtual net of the scenarios."""
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
            with suppress(OSError):  # refused or nobody there: lost, as on any network
                if way.sender is self._front:
                    way.sender.sendto(data, way.to)
                else:
                    way.sender.send(data)


def _udp_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    stamps.ask_for_stamps(sock)
    sock.bind((LOOPBACK, 0))
    return sock


@contextmanager
def lossy_udp(server_port: int, conditions: Conditions, *, seed: int) -> Iterator[LossyUdp]:
    """Run a proxy for a ``with`` block; datagrams pending at its end are delivered at once."""
    with closing(LossyUdp(server_port, conditions, seed=seed)) as proxy:
        yield proxy
