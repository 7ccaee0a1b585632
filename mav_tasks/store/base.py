"""What the runner needs of a journal: it keeps events in their order and says how far it is.

Events are numbered from 1 in the order in which they were appended, anew in each life of a process.
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
    """Events could not be made durable; the store goes on trying. ``text`` says what is wrong."""

    text: str


@dataclass(frozen=True, slots=True)
class HaltNotKept:
    """A halt of a vehicle is kept nowhere so far, and a restart would lose it."""

    vehicle: int
    text: str


Outcome = Kept | NotKept | HaltNotKept


class Store(Protocol):
    """The seam between the runner and the disk. What the disk does never raises here."""

    def append(self, events: Sequence[Event]) -> None:
        """Take events to be made durable, in order; returns at once."""
        ...

    def take_outcomes(self) -> list[Outcome]:
        """Return what became of them since the last call; returns at once."""
        ...

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while there are outcomes; None: there is none."""
        ...

    def close(self) -> None:
        """Finish what is under way and let go."""
        ...
