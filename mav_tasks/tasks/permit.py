"""Permits: what may still happen to a vehicle because somebody asked for it.

A permit ends at a given time, or with the vehicle's next halt. It remembers the term, the number of
halts until then, in which it was given. A halt changes the term, so no code has to delete permits.
"""

from math import inf
from typing import Generic, TypeVar

from mav_tasks.tasks.halts import Halts

T = TypeVar("T")


class Permit(Generic[T]):
    """A permit for one vehicle. Its holder is the client that has it, or what is permitted."""

    def __init__(self, halts: Halts) -> None:
        self._halts = halts
        self._holder: T | None = None
        self._term, self._until = -1, -inf

    def __repr__(self) -> str:
        return f"Permit({self._holder}, until={self._until:.2f})"

    def give(self, holder: T, *, until: float = inf) -> None:
        """Give the permit to a holder; this replaces the previous holder."""
        self._holder, self._term, self._until = holder, self._halts.term, until

    def end(self) -> None:
        """End the permit, because something else was requested since."""
        self._holder = None

    def holder(self, *, now: float = inf, halts: int = 0) -> T | None:
        """Return the holder, or None if the permit has ended.

        ``now`` may be left out for a permit that no time ends. ``halts``: return the holder of a
        permit that was given exactly so many halts ago.
        """
        is_in_time = now < self._until or self._until == inf
        return self._holder if is_in_time and self._term + halts == self._halts.term else None
