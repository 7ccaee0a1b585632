"""Links without sockets, in one process and in virtual time: a simulated, lossy network.

Deterministic: the same seed and the same traffic give the same losses.
"""

import heapq
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from random import Random
from typing import Protocol

from mav_tasks.links.base import Peer

#: ``fileno`` of the first link: no descriptor is as high, as the kernel's are signed 32-bit ints
FIRST_NUMBER = 2**31


@dataclass(frozen=True, slots=True)
class Conditions:
    """Impairments of the network. Delays in seconds; probabilities 0–1 for each datagram."""

    delay: float = 0.001
    jitter: float = 0.0  # a random extra delay of up to this: datagrams overtake each other
    loss: float = 0.0
    duplication: float = 0.0


class Buffer(Protocol):
    """A queue in which datagrams wait on the way from one link to another."""

    def leaves_at(self, size: int, *, now: float) -> float | None:
        """Return when a datagram of ``size`` bytes leaves the buffer; None: it is dropped."""


class Radio:
    """A radio of limited rate with a FIFO buffer of limited size."""

    def __init__(self, *, bytes_per_second: float, buffer: int) -> None:
        self._rate = bytes_per_second
        self._buffer = buffer  # bytes
        self._free_at = 0.0

    def __repr__(self) -> str:
        return f"Radio({self._rate} bytes/s, free at {self._free_at:.3f})"

    def leaves_at(self, size: int, *, now: float) -> float | None:
        """Return when a datagram has been sent; None: the buffer is full."""
        begins_at = max(now, self._free_at)
        if (begins_at - now) * self._rate + size > self._buffer:
            return None
        self._free_at = begins_at + size / self._rate
        return self._free_at


class Queue:
    """A varying delay that keeps the order of datagrams."""

    def __init__(self, delay: Callable[[float], float]) -> None:
        self._delay = delay  # time of sending -> delay, s
        self._last_at = 0.0

    def __repr__(self) -> str:
        return f"Queue(last at {self._last_at:.3f})"

    def leaves_at(self, size: int, *, now: float) -> float:  # noqa: ARG002
        """Return when a datagram arrives, never before the one in front of it."""
        self._last_at = max(self._last_at, now + self._delay(now))
        return self._last_at


class MemoryNet:
    """Carries datagrams between its links; the caller moves ``now`` forward."""

    def __init__(self, *, seed: int = 0, conditions: Conditions | None = None) -> None:
        self.now = 0.0
        self.conditions = conditions or Conditions()
        #: by source and target: a buffer, if datagrams queue on that path
        self.buffers: dict[tuple[str, str], Buffer] = {}
        self._random = Random(seed)
        self._links: dict[str, MemoryLink] = {}
        self._numbered: list[MemoryLink] = []
        self._under_way: list[tuple[float, int, str, str, bytes]] = []
        self._order = count()

    def link(self, name: str, *, peers: tuple[str, ...] = ()) -> "MemoryLink":
        """Return a new link whose peers know it by ``name``."""
        number = FIRST_NUMBER + len(self._numbered)
        link = self._links[name] = MemoryLink(self, name, peers, number)
        self._numbered.append(link)
        return link

    def is_readable(self, number: int) -> bool:
        """Whether the link with this ``fileno`` has received data."""
        return bool(self._numbered[number - FIRST_NUMBER].arrived)

    def conditions_between(self, source: str, target: str) -> Conditions:  # noqa: ARG002
        """Return the conditions of a path; override it for paths that differ."""
        return self.conditions

    def send(self, source: str, target: str, data: bytes) -> None:
        """Put a datagram in transit, lose it, or duplicate it."""
        how, buffer = self.conditions_between(source, target), self.buffers.get((source, target))
        copies = 0 if self._random.random() < how.loss else 1
        if copies and self._random.random() < how.duplication:
            copies = 2
        for _ in range(copies):
            left_at = self.now if buffer is None else buffer.leaves_at(len(data), now=self.now)
            if left_at is None:
                continue
            at = left_at + how.delay + self._random.random() * how.jitter
            heapq.heappush(self._under_way, (at, next(self._order), source, target, data))

    def next_arrival(self) -> float | None:
        return self._under_way[0][0] if self._under_way else None

    def deliver(self) -> None:
        """Put the datagrams that have arrived by ``now`` into their links."""
        while self._under_way and self._under_way[0][0] <= self.now:
            _, _, source, target, data = heapq.heappop(self._under_way)
            link = self._links.get(target)
            if link is not None:
                self.arrive(link, source, data)

    def arrive(self, link: "MemoryLink", source: str, data: bytes) -> None:
        """Put one datagram into its link; override it to observe the traffic."""
        link.arrived.append((source, data))
        link.times.append(self.now)


class MemoryLink:
    """One end on a MemoryNet; peers are names."""

    is_local = True
    is_stream = False
    note = ""

    def __init__(self, net: MemoryNet, name: str, peers: tuple[Peer, ...], number: int) -> None:
        self._net = net
        self._number = number
        self.name = name
        self.peers = peers
        self.arrived: deque[tuple[Peer, bytes]] = deque()
        self.times: deque[float] = deque()  # of their arrival

    def __repr__(self) -> str:
        return f"MemoryLink({self.name})"

    def fileno(self) -> int:
        """Return a unique number for ``MemoryNet.is_readable``; it is no descriptor."""
        return self._number

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        return self.receive_timed(limit)[0]

    def receive_timed(self, limit: int) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return datagrams as ``receive`` does, and when each arrived in the net's time."""
        count = min(limit, len(self.arrived))
        taken = [self.arrived.popleft() for _ in range(count)]
        return taken, [self.times.popleft() for _ in range(count)]

    def send(self, peer: Peer, data: bytes) -> None:
        self._net.send(self.name, str(peer), data)

    def close(self) -> None:
        """Drop the datagrams that have arrived."""
        self.arrived.clear()
        self.times.clear()
