"""What may still happen to a vehicle because somebody asked for it: until a time, or the next halt.

A permit holds the term in which it was given. One of another term is none: nobody deletes it.
"""

from math import inf
from typing import Generic, TypeVar

from mav_tasks.tasks.halts import Halts

T = TypeVar("T")


class Permit(Generic[T]):
    """One permit for one vehicle: who has it, or what it is about."""

    def __init__(self, halts: Halts) -> None:
        self._halts = halts
        self._holder: T | None = None
        self._term, self._until = -1, -inf

    def __repr__(self) -> str:
        return f"Permit({self._holder}, until={self._until:.2f})"

    def give(self, holder: T, *, until: float = inf) -> None:
        """Give it, in place of the last."""
        self._holder, self._term, self._until = holder, self._halts.term, until

    def end(self) -> None:
        """End it, because something else was requested since."""
        self._holder = None

    def holder(self, *, now: float, halts: int = 0) -> T | None:
        """Return whose it is, None if it is nobody's any more; ``halts``: after so many halts."""
        is_of_now = self._term + halts == self._halts.term and now < self._until
        return self._holder if is_of_now else None
