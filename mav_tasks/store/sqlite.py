"""The store on disk: a SQLite file that one server owns, with its own writer thread."""

import os
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from platformdirs import user_data_path

from mav_tasks.clock import boot_time
from mav_tasks.errors import StoreError
from mav_tasks.folders import make_private
from mav_tasks.settings import Retention
from mav_tasks.store import reading
from mav_tasks.store.base import Outcome, Which
from mav_tasks.store.database import Database
from mav_tasks.store.halt_keeper import HaltKeeper
from mav_tasks.store.halt_record import HaltRecord, event_of, word_of
from mav_tasks.store.journal import Journal
from mav_tasks.store.lock import Lock
from mav_tasks.store.mailbox import Mailbox
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.writer import Writer
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored

DEFAULT_STORE = "mav-tasks.sqlite3"
HALTS_LIMIT = 1.0  # s at shutdown for writing the last halts
CLOSE_LIMIT = 3.0  # s at shutdown for writing the remaining events
TRIM_AT_OPEN = 0.5  # s of deleting expired rows at start; the rest is done while serving


class SqliteStore:
    """Implements ``Store`` in a SQLite file. Files and folders that it creates are private.

    ``wall_offset`` returns the current UTC minus ``boot_time``. The constructor raises StoreError,
    with a text of one line, if the file cannot be used: in use by another process, damaged, newer,
    read-only, disk full.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        wall_offset: Callable[[], float],
        retention: Retention | None = None,
    ) -> None:
        self._wall_offset = wall_offset
        self._path = _real_path(Path(path))
        self.name = self.place = str(self._path)
        with ExitStack() as opened:
            opened.callback(Lock(self._path).release)
            record = HaltRecord(self._path)
            opened.callback(record.close)
            database = Database(self._path)
            was_complete = self._catch_up(database, record)
            release = opened.pop_all().close
        utc = boot_time() + wall_offset()
        self._ended_well = database.ended_well and was_complete
        self._idle = 0.0 if database.last_write is None else max(0.0, utc - database.last_write)
        self._mail = Mailbox()
        trimmer = Trimmer(retention or Retention())
        self._writer = Writer(
            database,
            self._mail,
            trimmer,
            name=self.name,
            wall_offset=wall_offset,
            record=record,
            release=release,
        )
        self._number = database.last_number
        self._keeper = HaltKeeper(
            record, self._mail, name=self.name, kept_through=lambda: database.last_number
        )
        self._is_open = True
        self._writer.trim_for(TRIM_AT_OPEN)
        self._writer.start()
        self._keeper.start()

    def __repr__(self) -> str:
        return f"SqliteStore({str(self._path)!r})"

    def load(self) -> Restored:
        """Return the stored state, times in this process's monotonic seconds; raise StoreError."""
        return reading.read_restored(
            self._path, offset=self._wall_offset(), ended_well=self._ended_well, idle=self._idle
        )

    def journal(self) -> Iterator[tuple[int, Event]]:
        """Yield every stored event, numbered over the life of the file; raise StoreError."""
        with closing(Journal(self._path)) as journal:
            yield from journal.take(offset=self._wall_offset())

    def append(self, events: Sequence[Event]) -> None:
        """Queue events to be made durable, without blocking; raise ValueError after ``close``."""
        if not self._is_open:
            raise ValueError("the store is closed")
        first, offset = self._number + 1, self._wall_offset()
        self._number += len(events)
        words = [
            word_of(event, number, offset=offset) for number, event in enumerate(events, first)
        ]
        halts = [word for word in words if word is not None]
        if halts:
            self._keeper.append(halts)
        self._writer.append(tuple(events))

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes since the last call; raise an exception of the store's threads."""
        return self._mail.take()

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while there are outcomes; None once closed."""
        return self._mail.fileno()

    def close(self) -> None:
        """Write the remaining events, record the clean end and release the lock.

        Give up after CLOSE_LIMIT if the disk fails or is stuck; the file stays locked while the
        disk is stuck.
        """
        if self._is_open:
            self._is_open = False
            self._keeper.close(within=HALTS_LIMIT)
            self._writer.close(within=CLOSE_LIMIT)
            self._keeper.report_lost()
            self._mail.close()

    def _catch_up(self, database: Database, record: HaltRecord) -> bool:
        """Write newer words of the halt record to the database; return False if it lacked any."""
        newer = record.words_after(database.last_number)
        next_id = record.next_id_after(database.last_number)
        if not newer and next_id is None:
            return True
        offset = self._wall_offset()
        database.catch_up(
            [event_of(word, offset=offset) for word in newer],
            last_number=record.last_number,
            next_id=next_id,
            offset=offset,
        )
        return False


def open_store(place: str, wall_offset: Callable[[], float], retention: Retention) -> SqliteStore:
    """Open a file; create it if it does not exist."""
    return SqliteStore(_path_of(place), wall_offset=wall_offset, retention=retention)


def open_journal(place: str, which: Which) -> Journal:
    return Journal(_path_of(place), which)


def read_parameters(place: str) -> dict[str, float]:
    """Return the parameters in a file; {} if it does not exist."""
    try:
        path = _path_of(place).expanduser().absolute()
        return reading.read_parameters(path) if path.exists() else {}
    except (OSError, RuntimeError) as error:
        raise StoreError(f"store {place}: {error}") from error


def _path_of(place: str) -> Path:
    return Path(place or user_data_path("mav-tasks", appauthor=False) / DEFAULT_STORE)


def _real_path(path: Path) -> Path:
    """Return the resolved path of a file; create its folder."""
    try:
        path = path.expanduser()
        _refuse_planted(path)
        path = path.resolve()
        make_private(path.parent)
    except (OSError, RuntimeError, ValueError) as error:
        words = getattr(error, "strerror", None) or str(error)
        raise StoreError(f"store {path}: its folder cannot be created: {words}") from error
    return path


def _refuse_planted(path: Path) -> None:
    """Raise StoreError for another user's symbolic link.

    The kernel would refuse to follow it in a world-writable sticky folder, but we resolve the path
    before the kernel sees the link.
    """
    try:
        found = path.lstat()
    except OSError:  # missing, or the next call reports the error
        return
    if stat.S_ISLNK(found.st_mode) and found.st_uid not in (0, os.geteuid()):
        raise StoreError(f"store {path}: it is a symbolic link of another user")
