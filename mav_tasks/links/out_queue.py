"""What waits for its turn on a stream: whole packets, none for long, the oldest dropped first.

The newest word is the one that counts, towards a rover as towards a client: a connection that had
stalled must not deliver old setpoints, nor answers that are taken for those to a later question.
"""

from collections import deque

MAX_BYTES = 1 << 16  # waiting for one peer
CONGESTED_AFTER = 0.1  # s that the first in the queue waits


class OutQueue:
    """The way out to one peer. ``now`` is any clock's that does not go back, in seconds."""

    def __init__(self, *, max_age: float) -> None:
        self._max_age = max_age
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._begun = b""  # the rest of a packet of which a part was written: nothing before it
        self._begun_at = 0.0
        self._size = 0
        self.is_congested = False
        self.dropped = 0  # packets

    def __repr__(self) -> str:
        return f"OutQueue({self.size} bytes wait, {self.dropped} packets dropped)"

    def __bool__(self) -> bool:
        return bool(self._begun or self._waiting)

    @property
    def size(self) -> int:
        """Bytes that wait."""
        return self._size + len(self._begun)

    def put(self, packet: bytes, *, now: float) -> None:
        """Let a packet wait; what is too old or too much goes."""
        self._waiting.append((now, packet))
        self._size += len(packet)
        while self._size > MAX_BYTES:
            self._drop()
        self._drop_old(now=now)

    def next(self, *, now: float) -> bytes:
        """Give what is to be written next; nothing if nothing waits."""
        if self._begun:
            return self._begun
        self._drop_old(now=now)
        return self._waiting[0][1] if self._waiting else b""

    def wrote(self, count: int) -> None:
        """So many bytes of what ``next`` gave were written."""
        if not self._begun:
            self._begun_at, self._begun = self._waiting.popleft()
            self._size -= len(self._begun)
        self._begun = self._begun[count:]

    def changed(self, *, now: float) -> bool:
        """Look whether it is congested; whether that changed."""
        since = self._begun_at if self._begun else self._waiting[0][0] if self._waiting else now
        was = self.is_congested
        self.is_congested = bool(self) and (was or now - since > CONGESTED_AFTER)
        return was is not self.is_congested

    def _drop_old(self, *, now: float) -> None:
        while self._waiting and now - self._waiting[0][0] > self._max_age:
            self._drop()

    def _drop(self) -> None:
        self._size -= len(self._waiting.popleft()[1])
        self.dropped += 1
