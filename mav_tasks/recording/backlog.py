"""A bounded queue of entries to write, filled by the loop and emptied by one thread.

It needs no lock, so the loop never waits for the thread: each side writes only its own counter, and
``deque`` appends and pops atomically.
"""

import time
from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

from mav_tasks.engine.inputs import AtOnce, Input, Packets

MOST = 32_000_000  # bytes, about
SMALL = 200  # bytes, about, of any value
ROOM_OF_PACKET = 400  # bytes, about, of a packet to send or an event

AT_A_TIME = 25  # entries between two pauses, about a fifth of a millisecond
PAUSE = 50e-6  # s, for which the thread sleeps, so that the loop can get the GIL

E = TypeVar("E")


def room_of(item: Input | None) -> int:
    """Return the approximate size of an input in memory, bytes."""
    if isinstance(item, AtOnce):
        return sum(map(room_of, item.packets), SMALL)
    if not isinstance(item, Packets):
        return SMALL
    room = SMALL
    for _, data in item.datagrams:  # faster than a generator expression
        room += SMALL + len(data)
    return room


class Backlog(Generic[E]):
    """A FIFO queue of entries, bounded in bytes."""

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self._entries: deque[tuple[E, int]] = deque()
        self._put = 0  # bytes put in total; written only by the loop
        self._taken = 0  # bytes taken in total; written only by the thread

    def __repr__(self) -> str:
        return f"Backlog({len(self._entries)} entries, {self._put - self._taken} bytes)"

    def put(self, entry: E, room: int) -> bool:
        """Add an entry of ``room`` bytes; return False if there is no room for it."""
        if self._put - self._taken + room > self._most:
            return False
        self._put += room
        self._entries.append((entry, room))
        return True

    def taken(self) -> Iterator[E]:
        """Remove and yield entries until none is left; pause regularly to let the loop run."""
        count = 0
        while self._entries:
            entry, room = self._entries.popleft()
            self._taken += room
            yield entry
            count += 1
            if count % AT_A_TIME == 0:
                time.sleep(PAUSE)
