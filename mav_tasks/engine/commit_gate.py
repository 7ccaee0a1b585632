"""Holds values back until all events recorded so far are durable, each with a time limit.

A value of ``hold_halt`` waits for the halts alone, which the store may keep before other events.
``knows`` registers, once for each type, how such a value is carried out and how it is given up.
Values that wait for the same leave in the order in which they came.
"""

from collections import deque
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
    """A value, the number of the event that must be kept, and when the value is given up."""

    number: int
    until: float
    what: Any
    is_halt: bool


class CommitGate:
    """A queue of values, in the order in which they came."""

    def __init__(self, registry: TaskRegistry, timers: Timers, *, within: float) -> None:
        """``within``: seconds that each value waits at most."""
        self._registry = registry
        self.within = within
        self._held: deque[_Held] = deque()
        self._halts = 0  # number up to which the halts are kept
        self._accept: dict[type, Step[Any]] = {}
        self._give_up: dict[type, Step[Any]] = {}
        self._timer = timers.timer(Turn.SUBMISSIONS, self._give_up_late)

    def __len__(self) -> int:
        return len(self._held)

    def knows(self, kind: type[Kind], accept: Step[Kind], give_up: Step[Kind]) -> None:
        """Register how values of a type are carried out, and given up."""
        self._accept[kind], self._give_up[kind] = accept, give_up

    def hold(self, what: object, *, now: float) -> None:
        """Carry out a value once all events recorded so far are durable, or give it up if late."""
        self._hold(_Held(self._registry.recorded, now + self.within, what, False), now=now)

    def hold_halt(self, what: object, *, now: float) -> None:
        """Carry out a value once a restart of the server would know all halts recorded so far."""
        self._hold(_Held(self._registry.halted, now + self.within, what, True), now=now)

    def committed(self, through: int, *, now: float) -> None:
        """Carry out all values that waited for events up to ``through``."""
        self._let_out(through, now=now)

    def halts_kept(self, through: int, *, now: float) -> None:
        """Carry out all values that waited for halts up to ``through``."""
        self._halts = through
        self._let_out(self._registry.durable, now=now)

    def _hold(self, held: _Held, *, now: float) -> None:
        if self._is_kept(held, self._registry.durable):
            self._accept[type(held.what)](held.what, now=now)
            return
        self._held.append(held)
        self._plan()

    def _is_kept(self, held: _Held, durable: int) -> bool:
        return held.number <= (max(durable, self._halts) if held.is_halt else durable)

    def _let_out(self, durable: int, *, now: float) -> None:
        """Carry out what waits for nothing any more, and what that holds back in turn."""
        while kept := [held for held in self._held if self._is_kept(held, durable)]:
            self._held = deque(held for held in self._held if not self._is_kept(held, durable))
            for held in kept:
                self._accept[type(held.what)](held.what, now=now)
        self._plan()

    def _give_up_late(self, *, now: float) -> None:
        """Give up the values that have waited too long."""
        while self._held and self._held[0].until <= now:
            held = self._held.popleft()
            self._give_up[type(held.what)](held.what, now=now)
        self._plan()

    def _plan(self) -> None:
        self._timer.set(self._held[0].until if self._held else inf)
