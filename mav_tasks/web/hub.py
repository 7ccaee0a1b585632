"""Server-sent events for any number of readers. Each event is encoded once. WHATWG HTML, 9.2.

Events have numbers, so a reader that reconnects gets the events that it missed. States of rovers
come many times a second and have no number: a slow reader skips some and gets the latest. A reader
that misses other events gets a new snapshot. No reader delays another one.

There is always room for a new reader: of too many, one ends that has not taken what it was given,
else the oldest of the user who has the most. What is kept for readers is bounded in bytes.
"""

import asyncio
import json
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable, Iterable
from typing import Any

from mav_tasks.basics.crowd import first_of_crowd

KEPT = 2000  # events for readers that reconnect
KEPT_BYTES = 4_000_000
UNREAD = 500  # events that one reader may leave unread before it gets a snapshot instead
UNREAD_BYTES = 1_000_000
READERS = 200
SHARED = 0.1  # s, for which a snapshot is given to further readers
IDLE = 1.0  # s, after which a reader counts as one that does not read
SILENCE = (
    10.0  # s without an event, after which one without contents shows that the stream is alive
)
ALIVE = b"event: alive\ndata: {}\n\n"  # not a comment: a page's script does not see those
SNAPSHOT, VEHICLES = "snapshot", "vehicles"

_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode


class Hub:
    """The events of one view of the server.

    ``instance`` tells the numbers of this process from those of an earlier one. ``snapshot`` and
    ``vehicles`` return the data of those events at this moment.
    """

    def __init__(
        self, instance: str, *, snapshot: Callable[[], Any], vehicles: Callable[[], Any]
    ) -> None:
        self._instance = instance
        self._snapshot = snapshot
        self._vehicles = vehicles
        self._number = 0
        self._kept: deque[tuple[int, bytes]] = deque()
        self._kept_bytes = 0
        self._whole = (-1, 0.0, b"")  # the last snapshot, with its number and time
        self._readers: dict[Reader, None] = {}  # the oldest first

    def __repr__(self) -> str:
        return f"Hub({self._number} events, {len(self._readers)} readers)"

    @property
    def readers(self) -> int:
        """The number of open streams."""
        return len(self._readers)

    def publish(self, kind: str, value: Any) -> None:
        """Send an event to all readers."""
        self._number += 1
        frame = self._frame(kind, value, number=self._number)
        self._kept.append((self._number, frame))
        self._kept_bytes += len(frame)
        while len(self._kept) > KEPT or self._kept_bytes > KEPT_BYTES:
            self._kept_bytes -= len(self._kept.popleft()[1])
        for reader in self._readers:
            reader.put(frame)

    def publish_vehicles(self, value: Any) -> None:
        """Send states of rovers to all readers that keep up."""
        if not self._readers:
            return
        frame = self._frame(VEHICLES, value)
        for reader in self._readers:
            reader.put_vehicles(frame)

    def open(self, last: str | None, *, user: str = "") -> "Reader":
        """Return a new reader. ``last`` is the id of the last event that it got, if any.

        It counts as a reader once it takes its first event: its browser may have left before.
        """
        return Reader(self, last, user=user)

    def begin(self, reader: "Reader", last: str | None) -> None:
        """Add a reader. It continues after the event ``last``."""
        while len(self._readers) >= READERS:
            unread = [each for each in self._readers if each.is_unread]
            self._end(first_of_crowd(unread or list(self._readers), lambda each: each.user))
        missed = None if last is None else self._since(last)
        if missed is None:
            reader.is_behind = True
        else:
            reader.catch_up(missed)
        self._readers[reader] = None

    def close(self, reader: "Reader") -> None:
        """Forget a reader."""
        self._readers.pop(reader, None)

    def end(self) -> None:
        """End all streams."""
        for reader in list(self._readers):
            self._end(reader)

    def _end(self, reader: "Reader") -> None:
        """End a stream. It is no reader any more, also if nobody reads that it has ended."""
        reader.close()
        self.close(reader)

    def snapshot_frame(self) -> bytes:
        """Return the event that shows everything; readers that come together get the same one."""
        now = time.monotonic()
        number, made_at, frame = self._whole
        if number != self._number or now - made_at > SHARED:
            frame = self._frame(SNAPSHOT, self._snapshot(), number=self._number)
            self._whole = self._number, now, frame
        return frame

    def vehicles_frame(self) -> bytes:
        """Return the event that shows all rovers."""
        return self._frame(VEHICLES, self._vehicles())

    def _since(self, last: str) -> list[bytes] | None:
        """Return the events after one; None if they are not kept."""
        instance, dash, text = last.rpartition("-")
        if not dash or instance != self._instance or not text.isascii() or not text.isdigit():
            return None
        number = int(text[:20])
        oldest = self._kept[0][0] if self._kept else self._number + 1
        if not oldest - 1 <= number <= self._number:
            return None
        return [frame for each, frame in self._kept if each > number]

    def _frame(self, kind: str, value: Any, *, number: int | None = None) -> bytes:
        mark = "" if number is None else f"id: {self._instance}-{number}\n"
        return f"{mark}event: {kind}\ndata: {_encode(value)}\n\n".encode()


class Reader:
    """One event stream."""

    def __init__(self, hub: Hub, last: str | None, *, user: str) -> None:
        self._hub = hub
        self._last = last
        #: whose stream it is
        self.user = user
        self._given_at: float | None = None  # when it was given what it has not taken yet
        self._unread: deque[bytes] = deque()
        self._unread_bytes = 0
        self._vehicles: bytes | None = None
        self._wake = asyncio.Event()
        self.is_behind = False
        self.are_vehicles_behind = False
        self._is_closed = False

    @property
    def is_unread(self) -> bool:
        """Whether nobody takes what the reader was given."""
        return self._given_at is not None and time.monotonic() - self._given_at > IDLE

    def catch_up(self, missed: Iterable[bytes]) -> None:
        """Begin with the events that a reader missed, and the latest of all rovers."""
        self._unread.extend(missed)
        self._unread_bytes = sum(map(len, self._unread))
        self.are_vehicles_behind = True

    def put(self, frame: bytes) -> None:
        """Add an event; too many unread ones are replaced by a snapshot."""
        if len(self._unread) >= UNREAD or self._unread_bytes > UNREAD_BYTES:
            self._forget_unread()
            self.is_behind = True
        if not self.is_behind:
            self._unread.append(frame)
            self._unread_bytes += len(frame)
        self._wake.set()

    def put_vehicles(self, frame: bytes) -> None:
        """Add states of rovers; an unread one is replaced by the latest of all rovers."""
        if self._vehicles is None:
            self._vehicles = frame
        else:
            self.are_vehicles_behind = True
        self._wake.set()

    def close(self) -> None:
        """End the stream."""
        self._is_closed = True
        self._wake.set()

    async def frames(self) -> AsyncGenerator[bytes]:
        """Yield bytes for the stream until it is closed."""
        self._hub.begin(self, self._last)
        try:
            while not self._is_closed:
                data = self._take()
                if not data:
                    data = await self._next()
                self._given_at = time.monotonic()
                yield data
                self._given_at = None
        finally:
            self._hub.close(self)

    async def _next(self) -> bytes:
        self._wake.clear()
        try:
            async with asyncio.timeout(SILENCE):
                await self._wake.wait()
        except TimeoutError:
            return ALIVE
        return self._take() or ALIVE

    def _take(self) -> bytes:
        """Return the unread events; b"" if there are none."""
        if self.is_behind:
            self.is_behind = self.are_vehicles_behind = False
            self._forget_unread()
            self._vehicles = None
            return self._hub.snapshot_frame()
        data = b"".join(self._unread)
        self._forget_unread()
        if self.are_vehicles_behind:
            data += self._hub.vehicles_frame()
        elif self._vehicles is not None:
            data += self._vehicles
        self._vehicles, self.are_vehicles_behind = None, False
        return data

    def _forget_unread(self) -> None:
        self._unread.clear()
        self._unread_bytes = 0
