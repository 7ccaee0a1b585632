"""A connection to a database, for SQL that every kind of store understands: ``?`` is a value.

So the writing of a batch, the reading of the state and of the journal, and the retention are the
same for every kind.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol


class Cursor(Protocol):
    """The rows that a statement has found."""

    def fetchone(self) -> Any:
        """Return the next row; None if there are no more."""

    def fetchmany(self, size: int, /) -> list[Any]: ...

    def fetchall(self) -> list[Any]: ...

    def __iter__(self) -> Iterator[Any]: ...


class Connection(Protocol):
    """Executes statements. Methods raise the errors of the kind's own library."""

    def execute(self, statement: str, values: Sequence[Any] = (), /) -> Cursor: ...

    def executemany(self, statement: str, rows: Any, /) -> object: ...
