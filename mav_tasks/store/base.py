"""The store interface: makes events durable in order, and reports up to which number.

Events are numbered in the order of ``append``; the count begins at 1 in each process.
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
    """Events could not be made durable; the store keeps trying. ``text`` tells the reason."""

    text: str


@dataclass(frozen=True, slots=True)
class HaltNotKept:
    """A halt of a vehicle is not stored anywhere yet; a restart would lose it."""

    vehicle: int
    text: str


Outcome = Kept | NotKept | HaltNotKept


class Store(Protocol):
    """The interface between runner and disk. Disk failures are outcomes, never exceptions."""

    def append(self, events: Sequence[Event]) -> None:
        """Queue events to be made durable, in order; return at once."""
        ...

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes since the last call, at once."""
        ...

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while there are outcomes, or None."""
        ...

    def close(self) -> None:
        """Finish pending writes and close the store."""
        ...
