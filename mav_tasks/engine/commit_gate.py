"""Holds values back until all events recorded so far are durable, each with a time limit.

``knows`` registers, once for each type, how such a value is carried out and how it is given up.
Values leave in the order in which they came.
"""

from collections import deque
from math import inf
from typing import Any, Protocol, TypeVar

from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.tasks.registry import TaskRegistry

Kind = TypeVar("Kind")
Kind_contra = TypeVar("Kind_contra", contravariant=True)


class Step(Protocol[Kind_contra]):
    """A function that carries out, or gives up, one value."""

    def __call__(self, held: Kind_contra, /, *, now: float) -> None: ...


class CommitGate:
    """A queue of values, in the order of the events that they wait for."""

    def __init__(self, registry: TaskRegistry, timers: Timers, *, within: float) -> None:
        """``within``: seconds that each value waits at most."""
        self._registry = registry
        self.within = within
        #: (number of the event that must be durable, when to give up, value)
        self._held: deque[tuple[int, float, Any]] = deque()
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
        if self._registry.recorded <= self._registry.durable:
            self._accept[type(what)](what, now=now)
            return
        if not self._held:
            self._timer.set(now + self.within)
        self._held.append((self._registry.recorded, now + self.within, what))

    def committed(self, through: int, *, now: float) -> None:
        """Carry out all values that waited for events up to ``through``."""
        while self._held and self._held[0][0] <= through:
            _, _, what = self._held.popleft()
            self._accept[type(what)](what, now=now)
        self._plan()

    def _give_up_late(self, *, now: float) -> None:
        """Give up the values that have waited too long."""
        while self._held and self._held[0][1] <= now:
            _, _, what = self._held.popleft()
            self._give_up[type(what)](what, now=now)
        self._plan()

    def _plan(self) -> None:
        self._timer.set(self._held[0][1] if self._held else inf)
