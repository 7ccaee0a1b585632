"""What waits to be written: filled by the loop, emptied by one thread, bounded.

The loop never waits for the thread, and neither waits for a lock: each side has a counter of its
own, and a deque takes and gives whole entries.
"""

import time
from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

from mav_tasks.engine import inputs
from mav_tasks.engine.inputs import AtOnce, Input, Packets

MOST = 32_000_000  # bytes, about
SMALL = 200  # bytes, about, that any value takes
ROOM_OF_PACKET = 400  # the same of a packet to send, or of an event

AT_A_TIME = 25  # entries, about a fifth of a millisecond
PAUSE = 50e-6  # s, in which the loop takes over if it has something to do

E = TypeVar("E")


def room_of(item: Input | None) -> int:
    """Return how many bytes, about, an input takes in memory."""
    if isinstance(item, AtOnce | inputs.Backlog):
        return sum(map(room_of, item.packets), SMALL)
    if not isinstance(item, Packets):
        return SMALL
    room = SMALL
    for _, data in item.datagrams:  # a generator would cost more than what it counts
        room += SMALL + len(data)
    return room


class Backlog(Generic[E]):
    """Entries in their order."""

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self._entries: deque[tuple[E, int]] = deque()
        self._put = 0  # bytes so far; written by the loop only
        self._taken = 0  # the same, by the thread only

    def __repr__(self) -> str:
        return f"Backlog({len(self._entries)} entries, {self._put - self._taken} bytes)"

    def put(self, entry: E, room: int) -> bool:
        """Take an entry of so many bytes; False: there is no room for it."""
        if self._put - self._taken + room > self._most:
            return False
        self._put += room
        self._entries.append((entry, room))
        return True

    def taken(self) -> Iterator[E]:
        """Yield and forget what is there, until nothing is; makes way for the loop in between."""
        count = 0
        while self._entries:
            entry, room = self._entries.popleft()
            self._taken += room
            yield entry
            count += 1
            if count % AT_A_TIME == 0:
                time.sleep(PAUSE)
