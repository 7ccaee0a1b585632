"""A store in memory, lost with the process."""

from collections.abc import Sequence

from mav_tasks.store.base import Kept, Outcome
from mav_tasks.tasks.events import Event


class MemoryStore:
    """A journal that is lost with the process. Bounded: the oldest events are dropped first."""

    name = "in memory, lost with the process"

    def __init__(self, *, capacity: int = 100_000) -> None:
        self._capacity = capacity
        self._count = 0
        self._reported = 0
        self.events: list[Event] = []

    def __repr__(self) -> str:
        return f"MemoryStore({self._count} events)"

    def append(self, events: Sequence[Event]) -> None:
        """Add events."""
        self.events += events
        self._count += len(events)
        if len(self.events) > 2 * self._capacity:
            del self.events[: -self._capacity]

    def take_outcomes(self) -> list[Outcome]:
        """Return a Kept of the last event, if it is new since the last call."""
        if self._reported == self._count:
            return []
        self._reported = self._count
        return [Kept(self._count)]

    def fileno(self) -> None:
        """Return None: outcomes are available right after ``append``."""

    def close(self) -> None:
        """Do nothing: there is nothing to close."""
