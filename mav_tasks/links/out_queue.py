"""What waits for its turn on a stream: whole packets, none for long, the oldest dropped first.

The newest word is the one that counts, towards a rover as towards a client: a connection that had
stalled must not deliver old setpoints, nor answers that are taken for those to a later question.
What is to go first waits for nothing but the rest of a packet that has begun.
"""

from collections import deque

MAX_BYTES = 1 << 16  # waiting for one peer
CONGESTED_AFTER = 0.1  # s that the first in the queue waits


class OutQueue:
    """The way out to one peer. ``now`` is any clock's that does not go back, in seconds."""

    def __init__(self, *, max_age: float) -> None:
        self._max_age = max_age
        self._first: deque[tuple[float, bytes]] = deque()
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._begun = b""  # the rest of a packet of which a part was written: nothing before it
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
        """Bytes that wait."""
        return self._size + len(self._begun)

    def put(self, packet: bytes, *, now: float, first: bool = False) -> None:
        """Let a packet wait, ``first`` before all others; what is too old or too much goes."""
        (self._first if first else self._waiting).append((now, packet))
        self._size += len(packet)
        while self._size > MAX_BYTES:
            self._drop(self._waiting or self._first)
        self._drop_old(now=now)

    def next(self, *, now: float) -> bytes:
        """Return what is to be written next; nothing if nothing waits."""
        if self._begun:
            return self._begun
        self._drop_old(now=now)
        return self._next[0][1] if self._next else b""

    def wrote(self, count: int) -> None:
        """So many bytes of what ``next`` gave were written."""
        if not self._begun:
            self._begun_at, self._begun = self._next.popleft()
            self._size -= len(self._begun)
        self._begun = self._begun[count:]

    def changed(self, *, now: float) -> bool:
        """Look whether it is congested; whether that changed."""
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
