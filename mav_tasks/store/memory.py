"""A store that is durable as long as the process lives, and no longer."""

from collections.abc import Sequence

from mav_tasks.store.base import Kept, Outcome
from mav_tasks.tasks.events import Event


class MemoryStore:
    """A journal that is lost with the process. Bounded: the oldest events go first."""

    name = "in memory, lost with the process"

    def __init__(self, *, capacity: int = 100_000) -> None:
        self._capacity = capacity
        self._count = 0
        self._reported = 0
        self.events: list[Event] = []

    def __repr__(self) -> str:
        return f"MemoryStore({self._count} events)"

    def append(self, events: Sequence[Event]) -> None:
        """Keep events."""
        self.events += events
        self._count += len(events)
        if len(self.events) > 2 * self._capacity:
            del self.events[: -self._capacity]

    def take_outcomes(self) -> list[Outcome]:
        """Return the number of the last event, if there is a new one."""
        if self._reported == self._count:
            return []
        self._reported = self._count
        return [Kept(self._count)]

    def fileno(self) -> None:
        """Outcomes are there as soon as events have been appended: nobody waits for them."""

    def close(self) -> None:
        """Nothing is open."""
