"""Datagrams that wait until they can leave for other gateways: bounded, and none leaves too late.

A MAVLink packet that comes late does more harm than one that is lost. So each datagram has a time
until which it may leave, and if too many wait for one gateway, the oldest are dropped. Those that
stop a vehicle (``first``) overtake all others, and are dropped last; as long as
nothing can leave, they do not become too old.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import TypeVar

T = TypeVar("T")

LIMIT = 1_000  # ordinary datagrams for one gateway, and as many that are first
KEPT = 1.0  # s for which a datagram that is first is never dropped
#: s from the beginning of a connection, in which those that are first leave at any age: until then
#: the others are connected again, too
AFTER_LOSS = 3.0
ALL = ""  # instead of a name: all other gateways


@dataclass(frozen=True, slots=True)
class Waiting:
    """A datagram that was given to ``send`` at ``at``, and may leave until ``until``."""

    payload: bytes
    at: float
    until: float
    first: bool = False


class Pressing(Enum):
    """How soon something must leave."""

    NOT = auto()
    SOON = auto()
    NOW = auto()


@dataclass(slots=True)
class _Queue:
    first: deque[Waiting] = field(default_factory=deque)
    ordinary: deque[Waiting] = field(default_factory=deque)


class Outbox:
    """The datagrams that wait, by the name of the gateway that they are for."""

    def __init__(self) -> None:
        self._queues: dict[str, _Queue] = {}
        #: first for all: also for a gateway that is met while they are kept; and who has got them
        self._for_all: deque[tuple[Waiting, set[str]]] = deque()
        self._names: frozenset[str] = frozenset()
        self.dropped = 0  # because too many waited
        self.expired = 0  # because they could not leave in time

    def __repr__(self) -> str:
        waiting = {name: len(q.first) + len(q.ordinary) for name, q in self._queues.items()}
        return f"Outbox({waiting}, {self.dropped} dropped, {self.expired} expired)"

    def put(self, to: str, item: Waiting) -> None:
        """Add a datagram for the gateway of this name, or for ALL that are met."""
        if to != ALL:
            self._put(to, item)
            return
        for name in self._names:
            self._put(name, item)
        if item.first:
            self._for_all.append((item, set(self._names)))
            _make_room(self._for_all, lambda entry: entry[0].at, item.at)

    def meet(self, names: frozenset[str], *, now: float) -> None:
        """Take which gateways can be reached now."""
        self._expire(now)
        for name in names - self._names:
            for item, got_by in self._for_all:
                if name not in got_by:
                    got_by.add(name)
                    self._put(name, item)
        self._names = names

    def renew(self, *, now: float) -> None:
        """A connection begins: what is first waited only because there was none."""
        until = now + AFTER_LOSS
        for queue in self._queues.values():
            queue.first = deque(_until(each, until) for each in queue.first)
        self._for_all = deque((_until(each, until), got_by) for each, got_by in self._for_all)

    def put_back(self, to: str, items: Iterable[Waiting]) -> None:
        """Put datagrams that are first back: it is not known whether they have arrived."""
        queue = self._queues.setdefault(to, _Queue())
        queue.first.extendleft(reversed(list(items)))

    def take(self, to: str, room: int, *, each: int, now: float) -> list[Waiting]:
        """Remove and return what may leave now, in order, in so many bytes with ``each`` a head."""
        found: list[Waiting] = []
        queue = self._queues.get(to)
        if queue is None:
            return found
        for waiting in (queue.first, queue.ordinary):
            while waiting:
                item = waiting[0]
                if item.until < now:
                    self.expired += 1
                elif (room := room - each - len(item.payload)) >= 0:
                    found.append(item)
                else:
                    return found
                waiting.popleft()
        del self._queues[to]
        return found

    def pressing(self) -> Pressing:
        """Return how soon something must leave for the gateways that can be reached."""
        found = Pressing.NOT
        for name, queue in self._queues.items():
            if name in self._names:
                if queue.first:
                    return Pressing.NOW
                found = Pressing.SOON
        return found

    def _put(self, name: str, item: Waiting) -> None:
        queue = self._queues.setdefault(name, _Queue())
        if item.first:
            queue.first.append(item)
            self.dropped += _make_room(queue.first, lambda each: each.at, item.at)
        else:
            queue.ordinary.append(item)
            if len(queue.ordinary) > LIMIT:
                queue.ordinary.popleft()
                self.dropped += 1

    def _expire(self, now: float) -> None:
        """Drop what is too late for gateways that cannot be reached, too."""
        while self._for_all and self._for_all[0][0].until < now:
            self._for_all.popleft()
        for name, queue in tuple(self._queues.items()):
            for waiting in (queue.first, queue.ordinary):
                while waiting and waiting[0].until < now:
                    waiting.popleft()
                    self.expired += 1
            if not queue.first and not queue.ordinary:
                del self._queues[name]


def _until(item: Waiting, until: float) -> Waiting:
    return replace(item, until=max(item.until, until))


def _make_room(items: deque[T], at: Callable[[T], float], now: float) -> int:
    """Drop the oldest while there are too many, but none that is still kept; return how many."""
    count = 0
    while len(items) > LIMIT and at(items[0]) < now - KEPT:
        items.popleft()
        count += 1
    return count
