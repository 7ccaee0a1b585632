"""A store in memory, lost with the process."""

from collections.abc import Callable, Iterator, Sequence

from mav_tasks.basics.errors import StoreError
from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import Committed
from mav_tasks.store.base import JournalReader, Outcome, Which
from mav_tasks.store.opening import IN_MEMORY
from mav_tasks.tasks.events import Event


class MemoryStore:
    """A journal that is lost with the process. Bounded: the oldest events are dropped first."""

    name = "in memory, lost with the process"
    place = IN_MEMORY

    def __init__(self, *, capacity: int = 100_000) -> None:
        self._capacity = capacity
        self._count = 0
        self._reported = 0
        self.events: list[Event] = []

    def __repr__(self) -> str:
        return f"MemoryStore({self._count} events)"

    def load(self) -> None:
        """Return None: nothing is kept over runs."""

    def journal(self) -> Iterator[tuple[int, Event]]:
        """Yield the events that have not been dropped."""
        yield from enumerate(self.events, 1 + self._count - len(self.events))

    def append(self, events: Sequence[Event]) -> None:
        self.events += events
        self._count += len(events)
        if len(self.events) > 2 * self._capacity:
            del self.events[: -self._capacity]

    def take_outcomes(self) -> list[Outcome]:
        """Return a Committed of the last event, if it is new since the last call."""
        if self._reported == self._count:
            return []
        self._reported = self._count
        return [Committed(self._count)]

    def fileno(self) -> None:
        """Return None: outcomes are available right after ``append``."""

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def open_store(
    _place: str, _wall_offset: Callable[[], float], _retention: Retention
) -> MemoryStore:
    return MemoryStore()


def open_journal(_place: str, _which: Which) -> JournalReader:
    """Raise StoreError: no other process can read it."""
    raise StoreError(
        "the server keeps its tasks in memory, so it has no journal; choose another store with "
        "--store"
    )


def read_parameters(_place: str) -> dict[str, float]:
    """Return {}: nothing is kept over runs."""
    return {}
