"""The store on a disk: a SQLite file that one server owns, written by a thread of its own."""

import os
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from mav_tasks.clock import boot_time
from mav_tasks.errors import StoreError
from mav_tasks.folders import make_private
from mav_tasks.settings import Retention
from mav_tasks.store.base import Outcome
from mav_tasks.store.database import Database
from mav_tasks.store.halt_keeper import HaltKeeper
from mav_tasks.store.halt_record import HaltRecord, event_of, word_of
from mav_tasks.store.journal import Journal
from mav_tasks.store.lock import Lock
from mav_tasks.store.mailbox import Mailbox
from mav_tasks.store.reading import read_restored
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.writer import Writer
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored

HALTS_LIMIT = 1.0  # s, for the last halts to be written when the server ends
CLOSE_LIMIT = 3.0  # s, for what is left to be written when the server ends
TRIM_AT_OPEN = 0.5  # s, for forgetting before the server serves; the rest is done beside it


class SqliteStore:
    """Implements ``Store``. Files and folders that it makes are its user's alone.

    ``wall_offset`` gives UTC minus ``boot_time``, now. StoreError, on making one, says in one
    line why the file cannot be used: by whom it is in use, damaged, newer, read-only, disk full.
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
        self.name = str(self._path)
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
        """Return what the file holds, all times in this process's monotonic seconds. StoreError."""
        return read_restored(
            self._path, offset=self._wall_offset(), ended_well=self._ended_well, idle=self._idle
        )

    def journal(self) -> Iterator[tuple[int, Event]]:
        """Yield every event that is kept, numbered over the life of the file. StoreError."""
        with closing(Journal(self._path)) as journal:
            yield from journal.take(offset=self._wall_offset())

    def append(self, events: Sequence[Event]) -> None:
        """Take events to be made durable; waits for nothing. ValueError once it is closed."""
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
        """Return what became of them since the last call. It raises what was our own mistake."""
        return self._mail.take()

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while there are outcomes; None once closed."""
        return self._mail.fileno()

    def close(self) -> None:
        """Write what is left, note the clean end and let others have the file.

        A disk that fails until then, or is stuck, is given up after CLOSE_LIMIT; while it is stuck
        the file stays locked.
        """
        if self._is_open:
            self._is_open = False
            self._keeper.close(within=HALTS_LIMIT)
            self._writer.close(within=CLOSE_LIMIT)
            self._keeper.report_lost()
            self._mail.close()

    def _catch_up(self, database: Database, record: HaltRecord) -> bool:
        """Bring into the database what its record of halts has beyond it; False: it lacked some."""
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


def _real_path(path: Path) -> Path:
    """Return the one name of a file, in a folder that is there."""
    try:
        path = path.expanduser()
        _refuse_planted(path)
        path = path.resolve()
        make_private(path.parent)
    except (OSError, RuntimeError, ValueError) as error:
        words = getattr(error, "strerror", None) or str(error)
        raise StoreError(f"store {path}: its folder cannot be made: {words}") from error
    return path


def _refuse_planted(path: Path) -> None:
    """Follow no link of another user, as the kernel does not where all may write.

    We look where it leads before the kernel is asked, so it could not.
    """
    try:
        found = path.lstat()
    except OSError:  # there is nothing, or what comes next says why not
        return
    if stat.S_ISLNK(found.st_mode) and found.st_uid not in (0, os.geteuid()):
        raise StoreError(f"store {path}: it is a symbolic link of another user")
