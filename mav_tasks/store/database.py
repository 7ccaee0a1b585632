"""The SQLite file: opening, writing batches, closing. Used by one thread at a time.

It uses WAL with synchronous=FULL: a transaction is durable when its COMMIT returns. Methods raise
sqlite3's errors.
"""

import os
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import suppress
from errno import ENOENT
from pathlib import Path
from typing import Any

from mav_tasks.errors import StoreError
from mav_tasks.store import schema
from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import Encoder, dumps, format_of
from mav_tasks.store.failures import words_for
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.schema import transaction
from mav_tasks.tasks.events import Event

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
    """An open store file. The constructor raises StoreError if the file cannot be used."""

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
                self.format_id = self._find_format()
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
            raise StoreError(f"store {path}: {words_for(error)}") from error
        self.next_id: int = row[0]
        self.last_number: int = row[1]
        self.last_write: float | None = row[2]  # UTC seconds, of an earlier process
        self.ended_well = bool(row[3])

    def __repr__(self) -> str:
        return f"Database({self._path.name}, event {self.last_number})"

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
        connection = self._connection
        with transaction(connection):
            # task ids wrap around: without retention an old task may still have the id
            _insert(
                connection,
                "OR REPLACE INTO tasks (id, number, vehicle, state, changed_at, submitted)",
                batch.tasks,
            )
            _insert(
                connection,
                "INTO journal (number, utc, kind, task_id, vehicle, body)",
                batch.journal,
            )
            for statement, rows in (
                (
                    "UPDATE tasks SET state = ?, changed_at = ?, changed = ? WHERE id = ?",
                    batch.changed,
                ),
                ("UPDATE tasks SET modified = ? WHERE id = ?", batch.modified),
                ("UPDATE tasks SET advanced = ? WHERE id = ?", batch.advanced),
                ("INSERT OR REPLACE INTO plans VALUES (?, ?, ?, ?)", batch.plans),
                ("INSERT OR REPLACE INTO parameters VALUES (?, ?)", batch.parameters),
            ):
                if rows:  # an executemany without rows still takes time
                    connection.executemany(statement, rows.values())
            if batch.withdrawn:
                self._withdraw(batch.withdrawn)
            for (column, vehicle), value in batch.vehicles.items():
                connection.execute(
                    f"INSERT INTO vehicles (vehicle, {column}) VALUES (?, ?)"
                    f" ON CONFLICT (vehicle) DO UPDATE SET {column} = excluded.{column}",
                    (vehicle, value),
                )
            if batch.signatures:
                _keep_signatures(connection, batch.signatures)
            connection.execute(
                "UPDATE meta SET next_id = ifnull(?, next_id), last_number = ?, last_write = ?,"
                " signed_until = max(signed_until, ?)",
                (batch.next_id, batch.last, utc, batch.signed_until),
            )
        if _identities(self._path) != self._files:
            raise OSError(ENOENT, GONE)  # the batch went to a file that is no longer there
        self.last_number = batch.last

    def catch_up(
        self, events: Sequence[Event], *, last_number: int, next_id: int | None, offset: float
    ) -> None:
        """Write events that an earlier process could not, before any other; raise StoreError.

        ``last_number`` is the last event number that the earlier process is known to have used.
        """
        first, encoder = last_number + 1, Encoder()
        batch = Batch(events, first=first, encoder=encoder, format_id=self.format_id, offset=offset)
        batch.next_id = next_id
        try:
            self.write(batch, utc=self.last_write or 0.0)
        except (OSError, sqlite3.Error) as error:
            self._connection.close()
            raise StoreError(f"store {self._path}: {words_for(error)}") from error

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

    def _withdraw(self, ids: Sequence[tuple[int]]) -> None:
        """Delete tasks, but keep their submissions in the journal."""
        self._connection.executemany(
            "INSERT INTO journal SELECT number, changed_at, 'TaskSubmitted', id, vehicle, submitted"
            " FROM tasks WHERE id = ?",
            ids,
        )
        self._connection.executemany("DELETE FROM tasks WHERE id = ?", ids)

    def _find_format(self) -> int:
        names = dumps(format_of(*Event.__args__))
        with transaction(self._connection):
            self._connection.execute("INSERT OR IGNORE INTO formats (names) VALUES (?)", (names,))
        query = "SELECT id FROM formats WHERE names = ?"
        return int(self._connection.execute(query, (names,)).fetchone()[0])

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


def _keep_signatures(
    connection: sqlite3.Connection, times: Mapping[tuple[Any, ...], int | None]
) -> None:
    connection.executemany(
        "DELETE FROM signatures"
        " WHERE key = ? AND link_id = ? AND system_id = ? AND component_id = ?",
        [sender for sender, time in times.items() if time is None],
    )
    connection.executemany(
        "INSERT OR REPLACE INTO signatures VALUES (?, ?, ?, ?, ?)",
        [(*sender, time) for sender, time in times.items() if time is not None],
    )


def _insert(connection: sqlite3.Connection, into: str, rows: list[tuple[Any, ...]]) -> None:
    """Insert many rows with few statements.

    sqlite3 releases and acquires the GIL for each statement, which is slow per row beside a busy
    engine. Chunk sizes are powers of two, so that few statements are compiled.
    """
    done, size = 0, MOST_ROWS
    while done < len(rows):
        while size > len(rows) - done:
            size //= 2
        chunk = rows[done : done + size]
        marks = f"({','.join('?' * len(chunk[0]))})"
        connection.execute(
            f"INSERT {into} VALUES {','.join([marks] * size)}",
            [value for row in chunk for value in row],
        )
        done += size
