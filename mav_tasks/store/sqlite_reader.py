"""A read-only connection to a store file, beside the server that writes it.

It takes no lock of the server's.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mav_tasks.store import schema
from mav_tasks.store.failures import failure
from mav_tasks.store.reading import in_one_line


class SqliteReader:
    """Implements ``Reader``. The constructor raises StoreError."""

    task_key = "id"

    def __init__(self, path: Path) -> None:
        self.name = str(path)
        with in_one_line(self):
            self.connection = _connect(path)

    def __repr__(self) -> str:
        return f"SqliteReader({self.name})"

    def is_empty(self) -> bool:
        """Whether the file has no table yet."""
        with in_one_line(self):
            return schema.is_empty(self.connection)

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Let every query of the block see one state of the file."""
        self.connection.execute("BEGIN")
        try:
            yield
        finally:
            self.connection.execute("ROLLBACK")

    def version(self) -> int:
        """Return a number that changes when another connection has written to the file."""
        return int(self.connection.execute("PRAGMA data_version").fetchone()[0])

    def failure(self, error: Exception) -> str | None:
        """Return the words for an error of SQLite."""
        if isinstance(error, sqlite3.Error):
            return failure(error) or str(error)
        return None

    def close(self) -> None:
        self.connection.close()


def _connect(path: Path) -> sqlite3.Connection:
    """Open a file read-only; as immutable if SQLite cannot write its index and no WAL exists."""
    try:
        return _checked(path, "mode=ro")
    except sqlite3.OperationalError:
        if path.with_name(f"{path.name}-wal").exists():
            raise
        return _checked(path, "immutable=1")


def _checked(path: Path, how: str) -> sqlite3.Connection:
    connection = sqlite3.connect(
        f"{path.as_uri()}?{how}", uri=True, isolation_level=None, check_same_thread=False
    )
    try:
        schema.check(connection)
    except BaseException:
        connection.close()
        raise
    return connection
