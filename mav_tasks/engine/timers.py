"""When each part of the engine is to be called next: one heap, of which the first is looked at.

A part sets its timer at the moment at which its need changes; nobody is asked. Most needs are only
put off, by each packet: such a timer comes up too early, and is entered anew then.
"""

from enum import IntEnum, auto
from heapq import heapify, heappop, heappush
from itertools import count
from math import inf
from operator import attrgetter
from typing import Protocol

SPARE = 64  # entries out of date in the heap, beyond which it is built anew


class Effect(Protocol):
    """What is done when its time has come."""

    def __call__(self, *, now: float) -> None: ...


class Turn(IntEnum):
    """Who comes first of those that are due at one moment: what makes a rover stand, above all."""

    LINKS = auto()
    VEHICLES = auto()
    SUBMISSIONS = auto()
    UPLOADS = auto()
    TASKS = auto()
    OPERATOR = auto()
    #: looking at what became of all that: done once, whether anybody is due or not
    SETTLING = auto()
    STATUSES = auto()
    HEARTBEATS = auto()
    REPORTS = auto()


_Entry = tuple[float, Turn, int, "Timer"]
_of_turn = attrgetter("turn")


class Timer:
    """When one part is to be called; made by ``Timers``."""

    __slots__ = ("_timers", "at", "do", "entered", "number", "period", "turn")

    def __init__(
        self, timers: "Timers", turn: Turn, number: int, do: Effect, period: float
    ) -> None:
        self._timers = timers
        self.turn = turn
        self.number = number
        self.do = do
        #: s, after which it comes again by itself; inf: not
        self.period = period
        #: when it comes; inf: never, as things are
        self.at = inf
        #: of its entries in the heap this one counts
        self.entered = inf

    def __repr__(self) -> str:
        return f"Timer({self.turn.name} {self.number}, at {self.at})"

    def set(self, at: float) -> None:
        """Come at that time instead; inf: not at all."""
        self.at = at
        if at < self.entered:
            self.entered = at
            timers = self._timers
            timers.not_before = min(timers.not_before, at)
            heappush(timers.heap, (at, self.turn, self.number, self))

    def bring_forward(self, at: float) -> None:
        """Come at that time, if it is not to come before."""
        if at < self.at:
            self.set(at)


class Timers:
    """The timers of all parts."""

    def __init__(self) -> None:
        self.heap: list[_Entry] = []
        #: no timer comes before this; the first may come later
        self.not_before = inf
        self._numbers = count()
        self._most = SPARE

    def __repr__(self) -> str:
        return f"Timers({len(self.heap)} entries, none before {self.not_before})"

    def timer(self, turn: Turn, do: Effect, *, number: int | None = None) -> Timer:
        """Return a timer that is not set yet; timers due in the same turn run by their number."""
        number = next(self._numbers) if number is None else number
        return Timer(self, turn, number, do, inf)

    def rhythm(self, turn: Turn, do: Effect, *, period: float, now: float) -> Timer:
        """Return a timer that comes at once, and again each ``period``; late, without a burst."""
        timer = Timer(self, turn, next(self._numbers), do, period)
        timer.set(now)
        return timer

    def next_deadline(self) -> float:
        """Return when the first timer comes; inf: none does."""
        heap = self.heap
        while heap:
            at, _, _, timer = heap[0]
            if timer.at == at == timer.entered:
                self.not_before = at
                return at
            self._renew(heappop(heap))
        self.not_before = inf
        return inf

    def take_due(self, *, now: float) -> list[Timer]:
        """Return the timers that come by now, in the order of their turns."""
        heap, due = self.heap, list[Timer]()
        while heap and heap[0][0] <= now:
            entry = at, _, _, timer = heappop(heap)
            if not timer.at == at == timer.entered:
                self._renew(entry)
                continue
            due.append(timer)
            timer.at = timer.entered = inf
            if timer.period < inf:
                timer.at = timer.entered = max(at + timer.period, now + 0.5 * timer.period)
                heappush(heap, (timer.at, timer.turn, timer.number, timer))
        if len(heap) > self._most:
            self._forget_outdated()
        due.sort(key=_of_turn)  # of one turn whose time came first, and then by number
        return due

    def _renew(self, entry: _Entry) -> None:
        """Enter a timer anew that was put off; forget an entry that does not count any more."""
        at, _, _, timer = entry
        if timer.entered == at:
            timer.entered = timer.at
            if timer.at < inf:
                heappush(self.heap, (timer.at, timer.turn, timer.number, timer))

    def _forget_outdated(self) -> None:
        self.heap[:] = [entry for entry in set(self.heap) if entry[3].entered == entry[0]]
        heapify(self.heap)
        self._most = 2 * len(self.heap) + SPARE
