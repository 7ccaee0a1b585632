"""The journal: keeps events in their order and says up to where they are durable.

The store in memory is durable as long as the process lives, and no longer: what it reports as kept
is kept until then. Events are numbered by their order, from 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from mav_tasks.tasks.events import Event


@dataclass(frozen=True, slots=True)
class Kept:
    """All events up to and with this number are durable."""

    through: int


@dataclass(frozen=True, slots=True)
class NotKept:
    """Events could not be made durable; the store goes on trying."""

    text: str


Outcome = Kept | NotKept


class Store(Protocol):
    """What the runner needs of a journal."""

    def append(self, events: Sequence[Event]) -> None:
        """Take events to be made durable, in order; returns at once."""
        ...

    def take_outcomes(self) -> list[Outcome]:
        """Give what became of them since the last call."""
        ...

    def close(self) -> None:
        """Finish what is under way and let go."""
        ...


class MemoryStore:
    """A journal that is lost with the process. Bounded: the oldest events go first."""

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
        """Give the number of the last event, if there is a new one."""
        if self._reported == self._count:
            return []
        self._reported = self._count
        return [Kept(self._count)]

    def close(self) -> None:
        """Nothing is open."""
