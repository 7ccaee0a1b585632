"""The send queue of a stream: whole packets of limited age, the oldest dropped first.

The newest packet matters, to a rover as to a client: a connection that stalled must not deliver old
setpoints, nor old answers that a client takes for answers to a later request. A ``first`` packet
waits only for the rest of a partly written packet.
"""

from collections import deque

MAX_BYTES = 1 << 16  # waiting for one peer
CONGESTED_AFTER = 0.1  # s that the oldest packet has waited


class OutQueue:
    """The send queue to one peer. ``now``: seconds of any monotonic clock."""

    def __init__(self, *, max_age: float) -> None:
        self._max_age = max_age
        self._first: deque[tuple[float, bytes]] = deque()
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._begun = b""  # the rest of a partly written packet: it must go next
        self._begun_at = 0.0
        self._size = 0
        self.is_congested = False
        self.dropped = 0  # packets

    def __repr__(self) -> str:
        return f"OutQueue({self.size} bytes wait, {self.dropped} packets dropped)"

    def __bool__(self) -> bool:
        return bool(self._begun or self._first or self._waiting)

    @property
    def size(self) -> int:
        """Number of waiting bytes."""
        return self._size + len(self._begun)

    def put(self, packet: bytes, *, now: float, first: bool = False) -> None:
        """Queue a packet, ``first`` before all others; drop packets by age, and above MAX_BYTES."""
        (self._first if first else self._waiting).append((now, packet))
        self._size += len(packet)
        while self._size > MAX_BYTES:
            self._drop(self._waiting or self._first)
        self._drop_old(now=now)

    def next(self, *, now: float) -> bytes:
        """Return the bytes to write next; b"" if nothing waits."""
        if self._begun:
            return self._begun
        self._drop_old(now=now)
        return self._next[0][1] if self._next else b""

    def wrote(self, count: int) -> None:
        """Note that the first ``count`` of the bytes that ``next`` returned were written."""
        if not self._begun:
            self._begun_at, self._begun = self._next.popleft()
            self._size -= len(self._begun)
        self._begun = self._begun[count:]

    def changed(self, *, now: float) -> bool:
        """Update ``is_congested``; return whether it changed."""
        heads = [queue[0][0] for queue in (self._first, self._waiting) if queue]
        since = self._begun_at if self._begun else min(heads, default=now)
        was = self.is_congested
        self.is_congested = bool(self) and (was or now - since > CONGESTED_AFTER)
        return was is not self.is_congested

    @property
    def _next(self) -> deque[tuple[float, bytes]]:
        return self._first or self._waiting

    def _drop_old(self, *, now: float) -> None:
        for queue in (self._first, self._waiting):
            while queue and now - queue[0][0] > self._max_age:
                self._drop(queue)

    def _drop(self, queue: deque[tuple[float, bytes]]) -> None:
        self._size -= len(queue.popleft()[1])
        self.dropped += 1
