"""The store interface: makes events durable in order, and reports up to which number.

Events are numbered in the order of ``append``; the count begins at 1 in each process.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from mav_tasks.engine.inputs import (
    Committed,
    HaltNotStored,
    HaltsKept,
    IdsGranted,
    NonceTaken,
    StoreFailed,
    TasksElsewhere,
    VehiclesTaken,
)
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored


@dataclass(frozen=True, slots=True)
class Evicted:
    """The fleet has ended this gateway's lease: it can store nothing any more."""

    text: str


#: what a store tells; all but the last are inputs of the engine
Outcome = (
    Committed
    | HaltsKept
    | StoreFailed
    | HaltNotStored
    | IdsGranted
    | NonceTaken
    | VehiclesTaken
    | TasksElsewhere
    | Evicted
)


@dataclass(frozen=True, slots=True)
class Which:
    """A filter of events; None matches all.

    ``since`` is in UTC seconds, ``after`` the number of an event.
    """

    task: int | None = None
    vehicle: int | None = None
    since: float | None = None
    after: int | None = None


class Store(Protocol):
    """The interface between runner and disk. Disk failures are outcomes, never exceptions.

    Only ``load`` and ``journal`` raise: StoreError.
    """

    #: what people call the store
    name: str
    #: where ``opening.kind_of`` finds the store from any folder; a note on the disk names it
    place: str

    def load(self) -> Restored | None:
        """Return the state of earlier runs, times in this process's monotonic seconds.

        None: the store keeps no state over runs.
        """

    def journal(self) -> Iterator[tuple[int, Event]]:
        """Yield every stored event, numbered over the life of the store."""
        ...

    def append(self, events: Sequence[Event]) -> None:
        """Queue events to be made durable, in order; return at once."""

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes since the last call, at once."""

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while there are outcomes, or None."""

    def close(self) -> None:
        """Finish pending writes and close the store."""


class JournalReader(Protocol):
    """Reads the journal of a store, also while a server writes it. Methods raise StoreError."""

    def take(self, *, offset: float) -> Iterator[tuple[int, Event]]:
        """Yield the events after those yielded before, numbered over the life of the store.

        ``offset``, UTC minus monotonic seconds, is subtracted from times; 0 leaves them in UTC.
        """

    def version(self) -> int:
        """Return a number that changes when the store was written to."""

    def close(self) -> None:
        """Close the journal."""
