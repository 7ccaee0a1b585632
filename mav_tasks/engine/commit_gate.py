"""Holds effects back until all events recorded so far are durable, each with a time limit.

The answer to a command that halts a vehicle may leave earlier: once the store has kept the halts.
Effects that wait for the same are carried out in the order in which they came.
"""

from math import inf
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
        self._halts = 0  # number up to which the halts are kept
        self._timer = timers.timer(Turn.SUBMISSIONS, self._look)

    def __len__(self) -> int:
        return len(self._held)

    def hold(self, accept: Effect, give_up: Effect, *, now: float, is_halt: bool = False) -> None:
        """Do ``accept`` once all events recorded so far are durable, or ``give_up`` if late.

        ``is_halt``: it is enough that the halts among them are kept.
        """
        held = _Held(self._registry.recorded, now + self.within, is_halt, accept, give_up)
        if self._is_kept(held):
            accept(now=now)
            return
        if not self._held:
            self._timer.set(held.until)
        self._held.append(held)

    def committed(self, through: int, *, now: float) -> None:
        """Carry out all effects that waited for events up to ``through``."""
        self._registry.durable = through
        self._look(now=now)

    def halts_kept(self, through: int, *, now: float) -> None:
        """Carry out all effects that waited for halts up to ``through``."""
        self._halts = through
        self._look(now=now)

    def _is_kept(self, held: _Held) -> bool:
        durable = self._registry.durable
        return held.number <= durable or (held.is_halt and held.number <= self._halts)

    def _look(self, *, now: float) -> None:
        """Carry out what need not wait any more, and give up what has waited too long."""
        waiting, self._held = self._held, []
        for held in waiting:
            if self._is_kept(held):
                held.accept(now=now)
            elif held.until <= now:
                held.give_up(now=now)
            else:
                self._held.append(held)
        self._timer.set(min((held.until for held in self._held), default=inf))
