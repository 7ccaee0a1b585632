"""The journal of a store file, read back as events, also beside the server that writes it.

Read-only, without the server's lock, and page by page, each in a transaction of its own. A reader
that stays in one, whose output waits in a pager, say, would hold on to the state of then: the
write-ahead log could not be emptied, and a store that recovers from a full disk would not be sure.
"""

import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

from mav_tasks.errors import StoreError
from mav_tasks.store import schema
from mav_tasks.store.codec import Unreadable
from mav_tasks.store.reading import Rows, in_one_line
from mav_tasks.tasks.events import Event

PAGE = 500  # events in memory at a time, about

_KINDS = {kind.__name__: kind for kind in Event.__args__}


@dataclass(frozen=True, slots=True)
class Which:
    """Which events are read; None: whatever it is. ``since`` is in UTC seconds."""

    task: int | None = None
    vehicle: int | None = None
    since: float | None = None


class Journal:
    """What a file keeps, in its order. StoreError, here and in reading: one line says why not."""

    def __init__(self, path: Path, which: Which | None = None) -> None:
        self._path = path.expanduser().absolute()
        self._which = which or Which()
        if not self._path.is_file():
            raise StoreError(f"store {path}: there is no such file; --store names another")
        with in_one_line(self._path):
            self._connection = _connect(self._path)
        self._number = 0  # of the last event given
        self._task = 0  # id of the last task whose submission was given

    def __repr__(self) -> str:
        return f"Journal({self._path.name}, event {self._number})"

    def take(self, *, offset: float) -> Iterator[tuple[int, Event]]:
        """Yield the events after those given before, numbered over the life of the file.

        Their times are moved by ``offset``, UTC minus monotonic seconds; 0 leaves them in UTC.
        """
        while True:
            with in_one_line(self._path):
                page, has_more = self._page(offset)
            yield from page
            if not has_more:
                return

    def version(self) -> int:
        """Return a number that is another one when somebody has written to the file."""
        with in_one_line(self._path):
            return int(self._connection.execute("PRAGMA data_version").fetchone()[0])

    def close(self) -> None:
        """Let go of the file."""
        self._connection.close()

    def _page(self, offset: float) -> tuple[list[tuple[int, Event]], bool]:
        with self._connection:  # ends the transaction
            self._connection.execute("BEGIN")
            rows = Rows(self._connection)
            noted = self._rows("number, kind, body, 0", "journal", "number", self._number)
            begun = self._rows("number, 'TaskSubmitted', submitted, id", "tasks", "id", self._task)
        full = [found[-1][0] for found in (noted, begun) if len(found) == PAGE]
        through = min(full, default=None)  # beyond it the other table may have more
        found = [row for row in (*noted, *begun) if through is None or row[0] <= through]
        self._number = max([self._number, *(row[0] for row in found)])
        self._task = max([self._task, *(row[3] for row in found)])
        since = self._which.since
        page = sorted(_events(rows, found, offset), key=itemgetter(0))
        if since is not None:
            page = [entry for entry in page if entry[1].at + offset >= since]
        return page, through is not None

    def _rows(self, columns: str, table: str, key: str, after: int) -> list[tuple[Any, ...]]:
        """Return the next rows. A submission is in its task's own row; ids grow as numbers do."""
        is_tasks = table == "tasks"
        wanted = {
            f"{key} > ?": after,
            "id = ?" if is_tasks else "task_id = ?": self._which.task,
            "vehicle = ?": self._which.vehicle,
            "changed_at >= ?" if is_tasks else "utc >= ?": self._which.since,
        }
        asked = {term: value for term, value in wanted.items() if value is not None}
        where = " AND ".join(asked)
        return self._connection.execute(
            f"SELECT {columns} FROM {table} WHERE {where} ORDER BY {key} LIMIT {PAGE}",
            tuple(asked.values()),
        ).fetchall()


def _events(
    rows: Rows, found: Iterable[tuple[Any, ...]], offset: float
) -> Iterator[tuple[int, Event]]:
    """Read rows, those of a kind together: one by one would take several times as long."""
    of_kind: dict[str, list[tuple[int, str]]] = {}
    for number, kind, body, _ in found:
        of_kind.setdefault(kind, []).append((number, body))
    for kind, some in of_kind.items():
        if kind not in _KINDS:
            raise Unreadable(f"{kind} is unknown to this version")
        values = rows.values(_KINDS[kind], [body for _, body in some], offset)
        yield from zip((number for number, _ in some), values, strict=True)


def _connect(path: Path) -> sqlite3.Connection:
    """Open a file read-only; where not even SQLite's index may be written, just as it is."""
    try:
        return _checked(path, "mode=ro")
    except sqlite3.OperationalError:
        if path.with_name(f"{path.name}-wal").exists():
            raise
        return _checked(path, "immutable=1")


def _checked(path: Path, how: str) -> sqlite3.Connection:
    connection = sqlite3.connect(f"{path.as_uri()}?{how}", uri=True, isolation_level=None)
    try:
        schema.check(connection)
        if schema.is_empty(connection):
            raise StoreError("nothing was ever written to it")
    except BaseException:
        connection.close()
        raise
    return connection
