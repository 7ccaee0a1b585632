"""Reads the journal of a store as events, also while a server writes it.

Each page is read in its own transaction. A long transaction, of a reader whose output waits in a
pager, say, would keep the server from checkpointing the WAL, and a store that recovers from a full
disk needs a full checkpoint.
"""

from collections.abc import Iterable, Iterator
from operator import itemgetter
from typing import Any

from mav_tasks.store.base import Which
from mav_tasks.store.codec import Unreadable
from mav_tasks.store.event_database import Reader
from mav_tasks.store.reading import Rows, in_one_line
from mav_tasks.tasks.events import Event

PAGE = 500  # rows of each table per page

_KINDS = {kind.__name__: kind for kind in Event.__args__}


class Journal:
    """Implements ``JournalReader`` for every kind of database."""

    def __init__(self, reader: Reader, which: Which) -> None:
        self._reader = reader
        self._which = which
        self._number = 0  # of the last event returned
        self._task = 0  # key of the last task whose submission was returned

    def __repr__(self) -> str:
        return f"Journal({self._reader.name}, event {self._number})"

    def take(self, *, offset: float) -> Iterator[tuple[int, Event]]:
        """Yield the events after those yielded before, as JournalReader says."""
        while True:
            with in_one_line(self._reader):
                page, has_more = self._page(offset)
            yield from page
            if not has_more:
                return

    def version(self) -> int:
        """Return a number that changes when the store was written to."""
        with in_one_line(self._reader):
            return self._reader.version()

    def close(self) -> None:
        self._reader.close()

    def _page(self, offset: float) -> tuple[list[tuple[int, Event]], bool]:
        with self._reader.snapshot():
            rows = Rows(self._reader.connection)
            noted = self._rows("number, kind, body, 0", "journal", "number", self._number)
            key = self._reader.task_key
            begun = self._rows(
                f"number, 'TaskSubmitted', submitted, {key}", "tasks", key, self._task
            )
        full = [found[-1][0] for found in (noted, begun) if len(found) == PAGE]
        through = min(full, default=None)  # above it the other table's page may be incomplete
        found = [row for row in (*noted, *begun) if through is None or row[0] <= through]
        self._number = max([self._number, *(row[0] for row in found)])
        self._task = max([self._task, *(row[3] for row in found)])
        since = self._which.since
        page = sorted(_events(rows, found, offset), key=itemgetter(0))
        if since is not None:
            page = [entry for entry in page if entry[1].at + offset >= since]
        return page, through is not None

    def _rows(self, columns: str, table: str, key: str, after: int) -> list[tuple[Any, ...]]:
        """Return the next rows of a table; a submission is stored in its task's row."""
        is_tasks = table == "tasks"
        wanted = {
            f"{key} > ?": after,
            "id = ?" if is_tasks else "task_id = ?": self._which.task,
            "vehicle = ?": self._which.vehicle,
            "? < number": self._which.after,
            "changed_at >= ?" if is_tasks else "utc >= ?": self._which.since,
        }
        asked = {term: value for term, value in wanted.items() if value is not None}
        where = " AND ".join(asked)
        return self._reader.connection.execute(
            f"SELECT {columns} FROM {table} WHERE {where} ORDER BY {key} LIMIT {PAGE}",
            tuple(asked.values()),
        ).fetchall()


def _events(
    rows: Rows, found: Iterable[tuple[Any, ...]], offset: float
) -> Iterator[tuple[int, Event]]:
    """Yield numbered events; decode rows of one kind together, which is several times faster."""
    of_kind: dict[str, list[tuple[int, str]]] = {}
    for number, kind, body, _ in found:
        of_kind.setdefault(kind, []).append((number, body))
    for kind, some in of_kind.items():
        if kind not in _KINDS:
            raise Unreadable(f"this version does not know {kind}")
        values = rows.values(_KINDS[kind], [body for _, body in some], offset)
        yield from zip((number for number, _ in some), values, strict=True)
