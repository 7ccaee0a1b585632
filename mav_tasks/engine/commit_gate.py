"""Holds values back until all events recorded so far are durable, each with a time limit.

The answer to a command that halts a vehicle may leave earlier: once the store has kept the halts.
``knows`` registers, once for each type, how such a value is carried out and how it is given up.
Values that wait for the same leave in the order in which they came.
"""

from math import inf
from typing import Any, NamedTuple, Protocol, TypeVar

from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.tasks.registry import TaskRegistry

Kind = TypeVar("Kind")
Kind_contra = TypeVar("Kind_contra", contravariant=True)


class Step(Protocol[Kind_contra]):
    """A function that carries out, or gives up, one value."""

    def __call__(self, held: Kind_contra, /, *, now: float) -> None: ...


class _Held(NamedTuple):
    """A value, the event that must be kept, until when, and whether only the halts must be."""

    number: int
    until: float
    is_halt: bool
    what: Any


class CommitGate:
    """The values that wait, in the order in which they came."""

    def __init__(self, registry: TaskRegistry, timers: Timers, *, within: float) -> None:
        """``within``: seconds that each value waits at most."""
        self._registry = registry
        self.within = within
        self._held: list[_Held] = []
        self._halts = 0  # number up to which the halts are kept
        self._accept: dict[type, Step[Any]] = {}
        self._give_up: dict[type, Step[Any]] = {}
        self._timer = timers.timer(Turn.SUBMISSIONS, self._look)

    def __len__(self) -> int:
        return len(self._held)

    def knows(self, kind: type[Kind], accept: Step[Kind], give_up: Step[Kind]) -> None:
        """Register how values of a type are carried out, and given up."""
        self._accept[kind], self._give_up[kind] = accept, give_up

    def hold(self, what: object, *, now: float, is_halt: bool = False) -> None:
        """Carry out a value once all events recorded so far are durable, or give it up if late.

        ``is_halt``: it is enough that the halts among them are kept.
        """
        held = _Held(self._registry.recorded, now + self.within, is_halt, what)
        if self._is_kept(held):
            self._accept[type(what)](what, now=now)
            return
        if not self._held:
            self._timer.set(held.until)
        self._held.append(held)

    def committed(self, through: int, *, now: float) -> None:
        """Carry out all values that waited for events up to ``through``."""
        self._registry.durable = through
        self._look(now=now)

    def halts_kept(self, through: int, *, now: float) -> None:
        """Carry out all values that waited for halts up to ``through``."""
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
                self._accept[type(held.what)](held.what, now=now)
            elif held.until <= now:
                self._give_up[type(held.what)](held.what, now=now)
            else:
                self._held.append(held)
        self._timer.set(min((held.until for held in self._held), default=inf))
