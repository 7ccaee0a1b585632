"""Holds effects back until all events recorded so far are durable, each with a time limit.

The answer to a command that halts a vehicle may leave earlier: once the store has kept the halts.
Effects that wait for the same are carried out in the order in which they came.
"""

from math import inf
from operator import itemgetter
from typing import NamedTuple

from mav_tasks.engine.timers import Effect, Timers, Turn
from mav_tasks.tasks.registry import TaskRegistry


class _Held(NamedTuple):
    """The event that must be kept, until when, and whether only the halts must be; and effects."""

    number: int
    until: float
    is_halt: bool
    accept: Effect
    give_up: Effect


class CommitGate:
    """The effects that wait, in the order in which they came."""

    def __init__(self, registry: TaskRegistry, timers: Timers, *, within: float) -> None:
        """``within``: seconds that each effect waits at most."""
        self._registry = registry
        self.within = within
        self._held: list[_Held] = []
        self.halts_kept = 0  #: number of the event up to which the halts are kept
        self._timer = timers.timer(Turn.SUBMISSIONS, self.look)

    def __len__(self) -> int:
        return len(self._held)

    def hold(self, accept: Effect, give_up: Effect, *, now: float, is_halt: bool = False) -> None:
        """Do ``accept`` once all events recorded so far are durable, or ``give_up`` if late.

        ``is_halt``: it is enough that the halts among them are kept.
        """
        number, until = self._registry.recorded, now + self.within
        if number <= self._registry.durable or (is_halt and number <= self.halts_kept):
            accept(now=now)
            return
        if not self._held:
            self._timer.set(until)
        self._held.append(_Held(number, until, is_halt, accept, give_up))

    def look(self, *, now: float) -> None:
        """Carry out what need not wait any more, and give up what has waited too long."""
        waiting, self._held, durable = self._held, [], self._registry.durable
        for held in waiting:
            number, until, is_halt, accept, give_up = held
            if number <= durable or (is_halt and number <= self.halts_kept):
                accept(now=now)
            elif until <= now:
                give_up(now=now)
            else:
                self._held.append(held)
        self._timer.set(min(map(itemgetter(1), self._held), default=inf))
