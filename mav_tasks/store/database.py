"""The SQLite file: opening, writing batches, closing. Used by one thread at a time.

It uses WAL with synchronous=FULL: a transaction is durable when its COMMIT returns. Methods raise
sqlite3's errors.
"""

import os
import secrets
import socket
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from errno import ENOENT
from pathlib import Path
from typing import Any

from mav_tasks.basics.errors import StoreError
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.store import schema
from mav_tasks.store.batch import Batch
from mav_tasks.store.batch_writing import find_format, write_batch
from mav_tasks.store.failures import failure
from mav_tasks.store.held_file import GONE, HeldFile, Identity, identity_of
from mav_tasks.store.holder import Holder, Replaced, words_for
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.schema import transaction
from mav_tasks.store.sqlite_reader import SqliteReader

BUSY_TIMEOUT = 0.25  # s, SQLite's wait for another program's lock
LOOK_PERIOD = 1.0  # s between two looks whether the file is still in its place
CHECKPOINT = 1_000  # pages in the WAL, about, as SQLite's own default
#: above it finished tasks are deleted, however few: each may have a plan of a few hundred KB
MOST_BYTES = 1 << 30
OF_A_BATCH, OF_A_TRIM = 8, 250  # pages, about
OVERWRITTEN = (
    "another file was copied over it while it was in use: this server can store nothing any more;"
    " end it, and remove the files -wal and -shm beside the store, which do not belong to the copy"
)
READ_AGAIN, READ_AFTER = 5, 0.02  # times and s, of a file that is being written
MOST_ROWS = 128  # in one INSERT: with seven columns below SQLite's oldest limit, 999 values

_PRAGMAS = (
    "PRAGMA journal_mode = WAL",
    "PRAGMA synchronous = FULL",
    "PRAGMA fullfsync = ON",  # macOS: fsync alone does not reach the disk
    "PRAGMA temp_store = MEMORY",
    f"PRAGMA journal_size_limit = {16 << 20}",  # bytes that the WAL keeps after a checkpoint
    "PRAGMA wal_autocheckpoint = 0",  # then every change of the file itself is of ``_checkpoint``
)


class Database:
    """An open store file; implements ``EventDatabase``, once ``begin`` has made it this server's.

    The lock of the file keeps other servers out. Whether it is still the only one, and its file the
    one that people find at its path, is checked before and after each transaction: by the names of
    file and WAL, by the row of ``writer``, whose epoch is a fencing token, and by that row's page
    in the file itself, for a file that was copied over another one has the same name and inode.
    That page changes only when a checkpoint writes a new random number there.

    Constructor and ``begin`` raise StoreError if the file cannot be used.
    """

    look_period = LOOK_PERIOD

    def __init__(self, path: Path, file: HeldFile) -> None:
        self._path = path
        self._file = file
        self._epoch, self._beat, self._page = 0, _random(), b""
        self._replaced: Replaced | None = None
        self._unwritten = 0  # pages in the WAL, about
        with self._at_start():
            if file.names > 1:
                raise StoreError(
                    "it has another name (a hard link), beside which SQLite's log may be:"
                    " remove that name, or copy the store"
                )
            _sync_folder(path)
            self._connection = _connect(path)
            try:
                schema.check(self._connection)
                _check_whole(self._connection)
                _set_up(self._connection)
                schema.migrate(self._connection)
                with transaction(self._connection):
                    self.format_id = find_format(self._connection)
                row = self._meta("next_id, last_number, last_write, ended_well, fleet")
                (root,) = self._row("SELECT rootpage FROM sqlite_master WHERE name = 'writer'")
                (self._page_size,) = self._row("PRAGMA page_size")
            except BaseException:
                self._connection.close()
                raise
        self._place = (root - 1) * self._page_size  # of the row of writer
        self._log = self._identity_of_log()
        self.next_id: int = row[0]
        self.last_number: int = row[1]
        self.last_write: float | None = row[2]  # UTC seconds, of an earlier process
        self.ended_well = bool(row[3])
        #: names the store, over its copies; "": it has no name yet
        self.fleet: str = row[4]

    def __repr__(self) -> str:
        return f"Database({self._path.name}, event {self.last_number})"

    def begin(self, fleet: str) -> None:
        """Become the writer, of the store with this name; durable before any rover is moved."""
        self._epoch = _random()
        with self._at_start():
            with transaction(self._connection):
                self._connection.execute("UPDATE meta SET ended_well = 0, fleet = ?", (fleet,))
                self._connection.execute(
                    "UPDATE writer SET epoch = ?, beats = ?, host = ?, pid = ?, since = ?",
                    (self._epoch, self._beat, socket.gethostname(), os.getpid(), time.time()),
                )
            self._checkpoint("FULL")
            self._log = self._identity_of_log()

    def is_open(self) -> bool:
        """Return whether the file is still the one that was opened, and in its place."""
        try:
            self._check_file()
        except (OSError, Replaced):
            return False
        return True

    def reopen(self) -> None:
        """Open the file again after a failure, and read the number of its last event.

        Raise OSError if the file is not in its place: another file lacks events reported as
        durable. Raise Replaced, at each later call, too, if its content is another store's.
        """
        try:
            self._check_file()
        except OSError:
            with suppress(sqlite3.Error):  # the file may have another name now, without its log
                self._checkpoint("PASSIVE")
            raise
        with suppress(sqlite3.Error):
            self._connection.close()
        self._note_page()  # closing may have written the log back
        self._connection = _connect(self._path)
        _set_up(self._connection)
        with transaction(self._connection):
            found = self._fence()
        if found < self.last_number:
            raise self._lost(OVERWRITTEN)
        self.last_number = found
        self._log = self._identity_of_log()

    def write(self, batch: Batch, *, utc: float) -> None:
        """Make a batch durable, as a whole or not at all."""
        self._unwritten += OF_A_BATCH + (batch.last - batch.first) // 2
        with self._fenced():
            write_batch(self._connection, batch, insert=self._insert, utc=utc)
        self.last_number = batch.last

    def refused(self, batch: Batch) -> list[NonceTaken]:  # noqa: ARG002
        """Return []: one server knows all nonces itself."""
        return []

    def is_certain(self) -> bool:
        """Checkpoint the WAL; return whether all of its pages are in the database file.

        A COMMIT that failed may still be found in the WAL. After a failed fsync its pages may not
        be on the disk: the commit counts only once a checkpoint has written them to the file.
        """
        return self._checkpoint("FULL")

    def trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        """Delete some expired rows; return whether there may be more."""
        self._unwritten += OF_A_TRIM
        with self._fenced():
            (pages,), (free,) = map(self._row, ("PRAGMA page_count", "PRAGMA freelist_count"))
            is_too_large = (pages - free) * self._page_size > MOST_BYTES
            return trimmer.step(self._connection, utc=utc, is_too_large=is_too_large)

    def close(self, *, utc: float | None) -> None:
        """Close the file; record a clean end at ``utc``, or none if None.

        A file that was copied over this one stays as it is, and so does a log that is not ours.
        """
        try:
            if utc is not None:
                with self._fenced():
                    self._connection.execute(
                        "UPDATE meta SET ended_well = 1, last_write = ?", (utc,)
                    )
        finally:
            if self._replaced is not None or self._identity_of_log() not in (self._log, None):
                self._file.leave_as_it_is()
            self._connection.close()

    def reader(self) -> SqliteReader:
        """Return a new read-only connection."""
        return SqliteReader(self._path)

    def failure(self, error: Exception) -> str | None:
        """Return the words for a disk failure; None: it is a bug of ours."""
        return failure(error)

    @contextmanager
    def _fenced(self) -> Iterator[None]:
        """Execute the block durably, unless the store is no longer this server's."""
        self._check()
        with transaction(self._connection):
            if self._fence() != self.last_number:
                raise self._lost(OVERWRITTEN)
            is_full = self._unwritten >= CHECKPOINT
            if is_full:
                self._connection.execute("UPDATE writer SET beats = ?", (self._beat,))
            yield
        self._check()  # else it went to a file that is no longer there
        if is_full:
            with suppress(sqlite3.Error):  # a full disk: the WAL has all of it
                self._checkpoint("PASSIVE")

    def _fence(self) -> int:
        """Return the number of the last event; raise Replaced if another server has begun."""
        query = "SELECT epoch, host, pid, since, last_number FROM writer, meta"
        *found, last_number = self._row(query)
        holder = Holder(*found)
        if holder.epoch != self._epoch:
            taken = "has taken the store over: this server can store nothing any more; end it"
            raise self._lost(f"{words_for(holder)} {taken}")
        return int(last_number)

    def _check(self) -> None:
        """Raise OSError or Replaced if what is written now is not what people find."""
        self._check_file()
        if self._identity_of_log() != self._log:
            raise OSError(ENOENT, GONE)

    def _check_file(self) -> None:
        if self._replaced is not None:
            raise self._replaced
        self._file.check()
        if self._page_on_disk() != self._page:
            raise self._lost(OVERWRITTEN)

    def _lost(self, words: str) -> Replaced:
        self._replaced = Replaced(words)
        return self._replaced

    def _checkpoint(self, mode: str) -> bool:
        """Write the WAL back to the file; return whether that was all of it."""
        try:
            query = f"PRAGMA wal_checkpoint({mode})"
            _, pages, done = self._connection.execute(query).fetchone()
        finally:
            self._note_page()
        self._unwritten = 0
        return bool(pages == done)

    def _note_page(self) -> None:
        """Note how a checkpoint has left the page of ``writer`` in the file.

        Raise Replaced if it is not a checkpoint that has changed it.
        """
        page = self._page_on_disk()
        if self._beat.to_bytes(8, "big") in page:
            self._beat = _random()
        elif page != self._page and self._epoch.to_bytes(8, "big") in self._page:
            raise self._lost(OVERWRITTEN)  # before, a reader may have kept our own out of the file
        self._page = page

    def _page_on_disk(self) -> bytes:
        return os.pread(self._file.fd, self._page_size, self._place)

    def _identity_of_log(self) -> Identity | None:
        return identity_of(self._path.with_name(f"{self._path.name}-wal"))

    @contextmanager
    def _at_start(self) -> Iterator[None]:
        try:
            yield
        except StoreError as error:
            raise StoreError(f"store {self._path}: {error}") from None
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"store {self._path}: {failure(error) or error}") from error

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
        return self._row(f"SELECT {columns} FROM meta")

    def _row(self, query: str) -> tuple[Any, ...]:
        row: tuple[Any, ...] | None = self._connection.execute(query).fetchone()
        if row is None:
            raise sqlite3.DatabaseError("a table has lost its row")
        return row


def holder_of(path: Path) -> Holder | None:
    """Return the server that another process has a file for, as far as the file says it.

    It is read without the WAL, which may be beside another name, and without locks: again if its
    server has just written to it.
    """
    for _ in range(READ_AGAIN):
        with suppress(sqlite3.Error):
            with closing(sqlite3.connect(f"{path.as_uri()}?immutable=1", uri=True)) as connection:
                row = connection.execute("SELECT epoch, host, pid, since FROM writer").fetchone()
            return None if row is None else Holder(*row)
        time.sleep(READ_AFTER)
    return None


def _random() -> int:
    """Return a random integer that SQLite stores as its eight bytes."""
    return secrets.randbits(62) | 1 << 62


def _sync_folder(path: Path) -> None:
    """Make the file's entry in its folder durable."""
    folder = os.open(path.parent, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


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
