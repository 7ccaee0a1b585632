"""The interfaces between a durable store and its kind of database."""

from contextlib import AbstractContextManager
from typing import Protocol

from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.store.batch import Batch
from mav_tasks.store.connection import Connection
from mav_tasks.store.retention import Trimmer


class Reader(Protocol):
    """A connection that only reads, beside the one that writes."""

    #: what people call the store
    name: str
    #: a column of ``tasks`` that increases with the number of the submission, and has an index
    task_key: str

    @property
    def connection(self) -> Connection: ...

    def snapshot(self) -> AbstractContextManager[object]:
        """Let every query of the block see one state of the database."""

    def version(self) -> int:
        """Return a number that changes when the store was written to."""

    def failure(self, error: Exception) -> str | None:
        """Return the words for an error of reading; None: it is a bug of ours."""

    def close(self) -> None: ...


class EventDatabase(Protocol):
    """An open database that one server owns. Used by one thread at a time.

    Methods raise the errors of the kind's own library; ``failure`` tells which are no bugs.
    """

    #: the next task id, last event number, time of the last write (UTC, s) and whether the end was
    #: recorded, as the database had them when it was opened; ``last_number`` is kept up to date
    next_id: int
    last_number: int
    last_write: float | None
    ended_well: bool
    #: number of the format in which this version writes its rows
    format_id: int
    #: s between two calls of ``is_open`` while there is nothing to write
    look_period: float

    def is_open(self) -> bool:
        """Return whether the database still seems usable, without delay."""

    def reopen(self) -> None:
        """Make the database usable after a failure, and read the number of its last event.

        Raise an error if it is another database: that lacks events reported as durable.
        """

    def write(self, batch: Batch, *, utc: float) -> None:
        """Make a batch durable, as a whole or not at all."""

    def refused(self, batch: Batch) -> list[NonceTaken]:
        """Return the submissions of a durable batch that were refused: others had their nonces.

        Several servers may write a database; only that then knows all nonces.
        """

    def is_certain(self) -> bool:
        """Return whether a batch that failed, and is there after ``reopen``, is durable."""

    def trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        """Delete some expired rows; return whether there may be more."""

    def close(self, *, utc: float | None) -> None:
        """Close the database; record a clean end at ``utc``, or none if None."""

    def reader(self) -> Reader:
        """Return a new connection for reading; any thread may call it. Raise StoreError."""

    def failure(self, error: Exception) -> str | None:
        """Return the words for a failure, which may be temporary; None: it is a bug of ours."""
