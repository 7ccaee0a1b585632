"""The store on disk: a SQLite file that one server owns."""

import os
import stat
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from secrets import token_hex

from platformdirs import user_data_path

from mav_tasks.basics.errors import StoreError
from mav_tasks.basics.folders import at_home, make_private
from mav_tasks.config.settings import Retention
from mav_tasks.store import reading
from mav_tasks.store.base import Which
from mav_tasks.store.database import Database, holder_of
from mav_tasks.store.durable import DurableStore
from mav_tasks.store.halt_record import HaltRecord
from mav_tasks.store.held_file import HeldFile, InUse
from mav_tasks.store.holder import words_for
from mav_tasks.store.journal import Journal
from mav_tasks.store.network_folder import MOUNTS, network_type
from mav_tasks.store.sqlite_reader import SqliteReader

DEFAULT_STORE = "mav-tasks.sqlite3"


class SqliteStore(DurableStore):
    """A store in a SQLite file. Files and folders that it creates are private.

    The constructor raises StoreError, with a text of one line, if the file cannot be used: in use
    by another process, damaged, newer, read-only, disk full.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        wall_offset: Callable[[], float],
        retention: Retention | None = None,
    ) -> None:
        asked = Path(path)
        path = _real_path(asked)
        name = str(path)
        with ExitStack() as opened:
            file = _held(path, asked.expanduser().absolute())
            opened.callback(file.close)
            database = Database(path, file)
            closing_database = opened.enter_context(ExitStack())
            closing_database.callback(database.close, utc=None)
            record = HaltRecord(path, name=name)
            opened.callback(record.close)
            # a new store, or a copy of an old one, goes on where the record's has ended
            fleet = database.fleet or record.fleet or token_hex(16)
            record.belong_to(fleet)
            database.begin(fleet)
            closing_database.pop_all()
            release = opened.pop_all().close
        super().__init__(
            database,
            record,
            name=name,
            wall_offset=wall_offset,
            retention=retention,
            release=release,
        )


def open_store(place: str, wall_offset: Callable[[], float], retention: Retention) -> SqliteStore:
    """Open a file; create it if it does not exist."""
    return SqliteStore(path_of(place), wall_offset=wall_offset, retention=retention)


def open_journal(place: str, which: Which) -> Journal:
    """Open the journal of a file; raise StoreError if it does not exist."""
    path = at_home(str(path_of(place)), what="store").absolute()
    if not path.is_file():
        raise StoreError(f"store {path_of(place)} does not exist; choose another with --store")
    reader = SqliteReader(path)
    if reader.is_empty():
        reader.close()
        raise StoreError(f"store {path}: it is empty")
    return Journal(reader, which)


def read_parameters(place: str) -> dict[str, float]:
    """Return the parameters in a file; {} if it does not exist, or has no tables yet."""
    try:
        path = path_of(place).expanduser().absolute()
        if not path.exists():
            return {}
        with closing(SqliteReader(path)) as reader:
            return {} if reader.is_empty() else reading.read_parameters(reader)
    except (OSError, RuntimeError) as error:
        raise StoreError(f"store {place}: {error}") from error


def path_of(place: str) -> Path:
    """Return the file of a store; for "" the one in the user's data folder."""
    return Path(place or user_data_path("mav-tasks", appauthor=False) / DEFAULT_STORE)


def _held(path: Path, asked: Path) -> HeldFile:
    """Lock a file; raise StoreError if that fails, or would not keep other machines out."""
    try:
        mounts = MOUNTS.read_text(encoding="utf-8", errors="replace")
    except OSError:
        mounts = ""
    if kind := network_type(path, mounts):
        raise StoreError(
            f"store {path}: its folder is on a network ({kind}), where another machine could write"
            " it, too: choose a local folder with --store, or PostgreSQL"
        )
    try:
        return HeldFile(path, asked=asked)
    except InUse:
        raise StoreError(f"store {path}: in use by {words_for(holder_of(path))}") from None
    except OSError as error:
        raise StoreError(f"store {path}: {error.strerror}") from error


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
