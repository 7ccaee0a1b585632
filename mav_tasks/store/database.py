"""The file: opening, writing batches, closing. One thread at a time; errors are sqlite3's.

WAL with synchronous=FULL: a transaction is on the disk when its COMMIT returns.
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

BUSY_TIMEOUT = 0.25  # s, that SQLite waits for another program's lock
GONE = "the file was removed or replaced while it was in use"
ANOTHER = "it is not the file that was opened: put that back, or end the server and look"
MOST_ROWS = 128  # in one INSERT: seven columns of them are below SQLite's oldest limit, 999 values

_PRAGMAS = (
    "PRAGMA journal_mode = WAL",
    "PRAGMA synchronous = FULL",
    "PRAGMA fullfsync = ON",  # macOS, where fsync alone does not reach the disk
    "PRAGMA temp_store = MEMORY",
    f"PRAGMA journal_size_limit = {16 << 20}",  # bytes that the WAL keeps after a checkpoint
)


class Database:
    """An open store file. StoreError, on making one, says in a line why it cannot be used."""

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
                with transaction(self._connection):  # durable before anything is moved
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
        self.last_write: float | None = row[2]  # UTC seconds, of an earlier life
        self.ended_well = bool(row[3])

    def __repr__(self) -> str:
        return f"Database({self._path.name}, event {self.last_number})"

    def reopen(self) -> None:
        """Open the file anew after a failure, and look which events are in it.

        Only the file that it was: another one in its place lacks what was promised to be in it.
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
        """Make a batch durable, all of it or nothing."""
        connection = self._connection
        with transaction(connection):
            # ids go round: where what is over is kept for ever, one may still be there
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
            if batch.changed:  # a statement for nothing takes its time, too
                connection.executemany(
                    "UPDATE tasks SET state = ?, changed_at = ?, changed = ? WHERE id = ?",
                    batch.changed.values(),
                )
            if batch.modified:
                connection.executemany(
                    "UPDATE tasks SET modified = ? WHERE id = ?", batch.modified.values()
                )
            if batch.advanced:
                connection.executemany(
                    "UPDATE tasks SET advanced = ? WHERE id = ?", batch.advanced.values()
                )
            if batch.plans:
                connection.executemany(
                    "INSERT OR REPLACE INTO plans VALUES (?, ?, ?, ?)", batch.plans.values()
                )
            if batch.parameters:
                connection.executemany(
                    "INSERT OR REPLACE INTO parameters VALUES (?, ?)", batch.parameters.values()
                )
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
            raise OSError(ENOENT, GONE)  # what was just written is nowhere that it can be found
        self.last_number = batch.last

    def catch_up(
        self, events: Sequence[Event], *, last_number: int, next_id: int | None, offset: float
    ) -> None:
        """Write events that an earlier life could not, before any other. StoreError.

        ``last_number`` is the last that the earlier life gave to any event.
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
        """Bring what is in the WAL into the file itself; False: it is not all there yet.

        A COMMIT that failed may yet be found in the WAL, though a failed fsync has promised
        nothing: it counts only once it has been written again, somewhere else.
        """
        _, pages, done = self._connection.execute("PRAGMA wal_checkpoint(FULL)").fetchone()
        return bool(pages == done)

    def trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        """Forget a little of what may be forgotten; True: there may be more."""
        with transaction(self._connection):
            return trimmer.step(self._connection, utc=utc)

    def close(self, *, utc: float | None) -> None:
        """Close the file; ``utc`` notes the clean end, None: it is none."""
        try:
            if utc is not None:
                with transaction(self._connection):
                    self._connection.execute(
                        "UPDATE meta SET ended_well = 1, last_write = ?", (utc,)
                    )
        finally:
            self._connection.close()

    def _withdraw(self, ids: Sequence[tuple[int]]) -> None:
        """The task goes; that it was submitted stays in the journal."""
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
    """Make the file and its folder, unless they are there, for nobody else to read."""
    fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    os.close(fd)
    folder = os.open(path.parent, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(folder)  # that the file is there is durable, too
    finally:
        os.close(folder)


def _identities(path: Path) -> tuple[tuple[int, int], ...]:
    """Return which files the store and its log are; OSError where one is not there."""
    return _identity(path), _identity(path.with_name(f"{path.name}-wal"))


def _identity(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError as error:
        raise OSError(ENOENT, GONE) from error
    return found.st_dev, found.st_ino


def _connect(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(
        f"{path.as_uri()}?mode=rw",  # never a new, empty one in place of what was removed
        uri=True,
        timeout=BUSY_TIMEOUT,
        isolation_level=None,
        check_same_thread=False,  # made by the main thread, used by the writer's
    )


def _set_up(connection: sqlite3.Connection) -> None:
    modes = [connection.execute(pragma).fetchone() for pragma in _PRAGMAS]
    if modes[0][0] != "wal":
        raise sqlite3.OperationalError("this file system has no room for a write-ahead log")


def _check_whole(connection: sqlite3.Connection) -> None:
    """Raise StoreError for a file that is damaged in its structure."""
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
    """Insert many rows by few statements.

    At each statement the interpreter's lock is let go and asked for again, and beside a busy
    engine that is a long way for each row. Powers of two, so that few statements are compiled.
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
