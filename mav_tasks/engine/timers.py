"""One heap of timers says when each part of the engine must run next.

A part sets its timer when its need changes; no part is polled. Most packets only postpone a timer.
A postponed timer keeps its early heap entry, which is replaced when it reaches the top.
"""

from dataclasses import dataclass
from enum import IntEnum, auto
from heapq import heapify, heappop, heappush
from itertools import count
from math import inf
from operator import attrgetter
from typing import Protocol

SPARE = 64  # outdated entries in the heap, beyond which the heap is rebuilt


class Effect(Protocol):
    """What a timer calls when it is due."""

    def __call__(self, *, now: float) -> None: ...


def leave_it(*, now: float) -> None:
    """Do nothing: the effect of what needs none."""


class Turn(IntEnum):
    """The order of timers that are due at one moment: what halts a rover comes first."""

    LINKS = auto()
    VEHICLES = auto()
    SUBMISSIONS = auto()
    UPLOADS = auto()
    TASKS = auto()
    OPERATOR = auto()
    #: processing the results of the turns above; done once per call, whether a timer is due or not
    SETTLING = auto()
    STATUSES = auto()
    HEARTBEATS = auto()
    REPORTS = auto()


_Entry = tuple[float, Turn, int, "Timer"]
_of_turn = attrgetter("turn")


@dataclass(slots=True, repr=False, eq=False)
class Timer:
    """The next call of one part; made by ``Timers``."""

    _timers: "Timers"
    turn: Turn
    number: int
    do: Effect
    #: s from one call to the next, or inf if it does not repeat
    period: float = inf
    #: when it is due, or inf if it is not set
    at: float = inf
    #: the time of its valid heap entry; its other entries are outdated
    entered: float = inf

    def __repr__(self) -> str:
        return f"Timer({self.turn.name} {self.number}, at {self.at})"

    def set(self, at: float) -> None:
        """Set the due time; inf cancels it."""
        self.at = at
        if at < self.entered:
            self.entered = at
            timers = self._timers
            timers.not_before = min(timers.not_before, at)
            heappush(timers.heap, (at, self.turn, self.number, self))


class Timers:
    """The timers of all parts."""

    def __init__(self) -> None:
        self.heap: list[_Entry] = []
        #: no timer is due before this time; the first one may be due later
        self.not_before = inf
        self._numbers = count()
        self._most = SPARE

    def __repr__(self) -> str:
        return f"Timers({len(self.heap)} entries, none before {self.not_before})"

    def timer(self, turn: Turn, do: Effect, *, number: int | None = None) -> Timer:
        """Return a timer that is not set; timers due in the same turn run by ``number``."""
        number = next(self._numbers) if number is None else number
        return Timer(self, turn, number, do)

    def forget(self, timer: Timer) -> None:
        """Cancel a timer for good, so that nothing refers to its part any more."""
        timer.at = timer.entered = inf
        self._forget_outdated()

    def rhythm(self, turn: Turn, do: Effect, *, period: float, now: float) -> Timer:
        """Return a timer that is due now and each ``period``; missed calls are not made up for."""
        timer = self.timer(turn, do)
        timer.period = period
        timer.set(now)
        return timer

    def next_deadline(self) -> float:
        """Return when the first timer is due, or inf if none is set."""
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
        """Return the timers that are due by ``now``, in the order of their turns."""
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
        due.sort(key=_of_turn)  # stable: within a turn by due time, then by number
        return due

    def _renew(self, entry: _Entry) -> None:
        """Re-enter a timer that was postponed; drop an outdated entry."""
        at, _, _, timer = entry
        if timer.entered == at:
            timer.entered = timer.at
            if timer.at < inf:
                heappush(self.heap, (timer.at, timer.turn, timer.number, timer))

    def _forget_outdated(self) -> None:
        self.heap[:] = [entry for entry in set(self.heap) if entry[3].entered == entry[0]]
        heapify(self.heap)
        self._most = 2 * len(self.heap) + SPARE
