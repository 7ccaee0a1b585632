"""The SQLite file: opening, writing batches, closing. Used by one thread at a time.

It uses WAL with synchronous=FULL: a transaction is durable when its COMMIT returns. Methods raise
sqlite3's errors.
"""

import os
import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from errno import ENOENT
from math import inf
from pathlib import Path
from typing import Any

from mav_tasks.errors import StoreError
from mav_tasks.store import schema
from mav_tasks.store.base import NonceTaken
from mav_tasks.store.batch import Batch
from mav_tasks.store.batch_writing import find_format, write_batch
from mav_tasks.store.failures import failure
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.schema import transaction
from mav_tasks.store.sqlite_reader import SqliteReader

BUSY_TIMEOUT = 0.25  # s, SQLite's wait for another program's lock
GONE = "the file was removed or replaced while it was in use"
ANOTHER = "it is not the file that was opened: restore that file, or end the server and check"
MOST_ROWS = 128  # in one INSERT: with seven columns below SQLite's oldest limit, 999 values

_PRAGMAS = (
    "PRAGMA journal_mode = WAL",
    "PRAGMA synchronous = FULL",
    "PRAGMA fullfsync = ON",  # macOS: fsync alone does not reach the disk
    "PRAGMA temp_store = MEMORY",
    f"PRAGMA journal_size_limit = {16 << 20}",  # bytes that the WAL keeps after a checkpoint
)


class Database:
    """An open store file; implements ``EventDatabase``.

    The constructor raises StoreError if the file cannot be used.
    """

    look_period = inf  # a file is not lost by itself

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            _create(path)
            self._connection = _connect(path)
            try:
                schema.check(self._connection)
                _check_whole(self._connection)
                _set_up(self._connection)
                schema.migrate(self._connection)
                with transaction(self._connection):
                    self.format_id = find_format(self._connection)
                row = self._meta("next_id, last_number, last_write, ended_well")
                with transaction(self._connection):  # durable before any rover is moved
                    self._connection.execute("UPDATE meta SET ended_well = 0")
                self._files = _identities(path)
            except BaseException:
                self._connection.close()
                raise
        except StoreError as error:
            raise StoreError(f"store {path}: {error}") from None
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"store {path}: {failure(error) or error}") from error
        self.next_id: int = row[0]
        self.last_number: int = row[1]
        self.last_write: float | None = row[2]  # UTC seconds, of an earlier process
        self.ended_well = bool(row[3])

    def __repr__(self) -> str:
        return f"Database({self._path.name}, event {self.last_number})"

    def is_open(self) -> bool:
        """Return True: whether the file is still there is seen when it is written to."""
        return True

    def reopen(self) -> None:
        """Open the file again after a failure, and read the number of its last event.

        Raise OSError if the file was replaced: another file lacks events reported as durable.
        """
        with suppress(sqlite3.Error):
            self._connection.close()
        if _identity(self._path) != self._files[0]:
            raise OSError(ENOENT, ANOTHER)
        self._connection = _connect(self._path)
        _set_up(self._connection)
        (self.last_number,) = self._meta("last_number")
        self._files = _identities(self._path)

    def write(self, batch: Batch, *, utc: float) -> None:
        """Make a batch durable, as a whole or not at all."""
        with transaction(self._connection):
            write_batch(self._connection, batch, insert=self._insert, utc=utc)
        if _identities(self._path) != self._files:
            raise OSError(ENOENT, GONE)  # the batch went to a file that is no longer there
        self.last_number = batch.last

    def refused(self, batch: Batch) -> list[NonceTaken]:  # noqa: ARG002
        """Return []: one server knows all nonces itself."""
        return []

    def is_certain(self) -> bool:
        """Checkpoint the WAL; return whether all of its pages are in the database file.

        A COMMIT that failed may still be found in the WAL. After a failed fsync its pages may not
        be on the disk: the commit counts only once a checkpoint has written them to the file.
        """
        _, pages, done = self._connection.execute("PRAGMA wal_checkpoint(FULL)").fetchone()
        return bool(pages == done)

    def trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        """Delete some expired rows; return whether there may be more."""
        with transaction(self._connection):
            return trimmer.step(self._connection, utc=utc)

    def close(self, *, utc: float | None) -> None:
        """Close the file; record a clean end at ``utc``, or none if None."""
        try:
            if utc is not None:
                with transaction(self._connection):
                    self._connection.execute(
                        "UPDATE meta SET ended_well = 1, last_write = ?", (utc,)
                    )
        finally:
            self._connection.close()

    def reader(self) -> SqliteReader:
        """Return a new read-only connection."""
        return SqliteReader(self._path)

    def failure(self, error: Exception) -> str | None:
        """Return the words for a disk failure; None: it is a bug of ours."""
        return failure(error)

    def _insert(self, table: str, columns: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> None:
        """Insert many rows with few statements.

        sqlite3 releases and acquires the GIL for each statement, which is slow per row beside a
        busy engine. Chunk sizes are powers of two, so that few statements are compiled. Task ids
        wrap around: without retention an old task may still have the id, hence OR REPLACE.
        """
        into = f"INSERT OR REPLACE INTO {table} ({','.join(columns)}) VALUES "
        mark = f"({','.join('?' * len(columns))})"
        done, size = 0, MOST_ROWS
        while done < len(rows):
            while size > len(rows) - done:
                size //= 2
            self._connection.execute(
                into + ",".join([mark] * size),
                [value for row in rows[done : done + size] for value in row],
            )
            done += size

    def _meta(self, columns: str) -> tuple[Any, ...]:
        row: tuple[Any, ...] | None = self._connection.execute(
            f"SELECT {columns} FROM meta"
        ).fetchone()
        if row is None:
            raise sqlite3.DatabaseError("the table meta is empty")
        return row


def _create(path: Path) -> None:
    """Create the file with mode 0600 unless it exists; make its folder entry durable."""
    fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    os.close(fd)
    folder = os.open(path.parent, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _identities(path: Path) -> tuple[tuple[int, int], ...]:
    """Return device and inode of the store and its WAL; raise OSError if one is missing."""
    return _identity(path), _identity(path.with_name(f"{path.name}-wal"))


def _identity(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError as error:
        raise OSError(ENOENT, GONE) from error
    return found.st_dev, found.st_ino


def _connect(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(
        f"{path.as_uri()}?mode=rw",  # never create an empty file if it was removed
        uri=True,
        timeout=BUSY_TIMEOUT,
        isolation_level=None,
        check_same_thread=False,  # created by the main thread, used by the writer's
    )


def _set_up(connection: sqlite3.Connection) -> None:
    modes = [connection.execute(pragma).fetchone() for pragma in _PRAGMAS]
    if modes[0][0] != "wal":
        raise sqlite3.OperationalError("this file system cannot hold a write-ahead log")


def _check_whole(connection: sqlite3.Connection) -> None:
    """Raise StoreError if SQLite's quick_check finds damage."""
    (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    if found != "ok":
        raise StoreError(f"it is damaged ({found.splitlines()[-1]})")
