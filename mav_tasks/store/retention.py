"""Deletes finished tasks with their events, and other old events, in bounded steps.

Whoever sends what, the journal is bounded: a number of events of each kind is kept of one task, of
no task, and in all. So a flood of one kind pushes out older events of that kind alone: no number of
refusals or changes pushes out a halt. A task that has not ended is never deleted, but of its events
only the latest are kept; its own row has its state.
"""

from collections.abc import Iterator
from math import inf

from mav_tasks.config.settings import Retention
from mav_tasks.store.connection import Connection

STEP = 250  # tasks deleted in one transaction
SWEEP = 2_000  # journal rows examined in one transaction
MOST_OF_TASK = 1_000  # events of one kind of one task
MOST_OF_NO_TASK = 20_000  # of one kind: refusals, halts, parameters, events of rovers
MOST_OF_KIND = 200_000
#: of the kinds that may have a whole plan in them, a few hundred KB
MOST_WITH_PLANS = {"PlanStored": 200, "TaskSubmitted": 200}  # the latter were withdrawn

_OVER = "state >= 9"  # the terminal states; the same condition as the index's


class Trimmer:
    """Applies a Retention step by step, each step within the caller's transaction."""

    def __init__(self, retention: Retention) -> None:
        self._retention = retention
        self._swept = 0  # number of the last journal row examined
        self._excess: dict[str, int] = {}  # how many events to delete, by condition
        self._has_more = False

    def step(
        self, connection: Connection, *, utc: float, kept: str = "", is_too_large: bool = False
    ) -> bool:
        """Delete some rows that are too old or too many; return whether there may be more.

        ``kept``: a condition of tasks that stay, in SQL; "": there are none. ``is_too_large``:
        delete finished tasks though they are not too many, unless all are to be kept.
        """
        if not self._has_more:  # counting takes longer than deleting
            self._excess = dict(_excess(connection))
        free = f"NOT {kept}" if kept else "TRUE"
        deleted = self._delete_tasks(connection, utc, free, is_too_large=is_too_large)
        self._delete_excess(connection)
        is_sweeping = self._sweep(connection, utc)
        self._has_more = is_sweeping or deleted >= STEP or bool(self._excess)
        return self._has_more

    def _delete_tasks(
        self, connection: Connection, utc: float, free: str, *, is_too_large: bool
    ) -> int:
        ids: list[tuple[int]] = []
        if self._retention.max_age is not None:
            ids = _oldest(connection, STEP, before=utc - self._retention.max_age, free=free)
        if self._retention.max_count is not None:
            (count,) = connection.execute(f"SELECT count(*) FROM tasks WHERE {_OVER}").fetchone()
            excess = min(count if is_too_large else count - self._retention.max_count, STEP)
            if excess > len(ids):
                ids = _oldest(connection, excess, before=inf, free=free)
        if ids:
            connection.executemany("DELETE FROM journal WHERE task_id = ?", ids)
            connection.executemany("DELETE FROM tasks WHERE id = ?", ids)
        return len(ids)

    def _delete_excess(self, connection: Connection) -> None:
        """Delete the oldest events of which there are too many: a client could fill a disk."""
        left = SWEEP
        for condition in list(self._excess):
            count = min(self._excess[condition], left)
            connection.execute(
                "DELETE FROM journal WHERE number IN (SELECT number FROM journal"
                f" WHERE {condition} ORDER BY number LIMIT ?)",
                (count,),
            )
            left -= count
            self._excess[condition] -= count
            if not self._excess[condition]:
                del self._excess[condition]
            if not left:
                return

    def _sweep(self, connection: Connection, utc: float) -> bool:
        """Delete old events without a stored task; return whether more rows must be examined."""
        if self._retention.max_age is None:
            return False
        too_old = utc - self._retention.max_age
        rows = connection.execute(
            "SELECT number, utc FROM journal WHERE number > ? ORDER BY number LIMIT ?",
            (self._swept, SWEEP),
        ).fetchall()
        if not rows:
            self._swept = 0
            return False
        connection.execute(
            "DELETE FROM journal WHERE number > ? AND number <= ? AND utc < ? AND NOT EXISTS"
            " (SELECT 1 FROM tasks WHERE tasks.id = journal.task_id)",
            (self._swept, rows[-1][0], too_old),
        )
        if rows[-1][1] >= too_old:  # all later rows are younger
            self._swept = 0
            return False
        self._swept = rows[-1][0]
        return True


def _excess(connection: Connection) -> Iterator[tuple[str, int]]:
    """Yield conditions, in SQL, of events of which too many are stored, and how many too many."""
    least = min(MOST_OF_TASK, MOST_OF_NO_TASK, *MOST_WITH_PLANS.values())
    query = "SELECT kind, task_id, count(*) FROM journal GROUP BY kind, task_id HAVING count(*) > ?"
    deleted: dict[str, int] = {}
    for kind, task_id, count in connection.execute(query, (least,)).fetchall():
        most, whose = MOST_OF_TASK, f"task_id = {task_id}"
        if task_id is None:
            most, whose = MOST_WITH_PLANS.get(kind, MOST_OF_NO_TASK), "task_id IS NULL"
        if count > most:
            yield f"kind = '{kind}' AND {whose}", count - most
            deleted[kind] = deleted.get(kind, 0) + count - most
    for kind, count in connection.execute("SELECT kind, count(*) FROM journal GROUP BY kind"):
        excess = count - deleted.get(kind, 0) - MOST_WITH_PLANS.get(kind, MOST_OF_KIND)
        if excess > 0:
            yield f"kind = '{kind}'", excess


def _oldest(connection: Connection, most: int, *, before: float, free: str) -> list[tuple[int]]:
    return connection.execute(
        f"SELECT id FROM tasks WHERE {_OVER} AND changed_at < ? AND {free}"
        " ORDER BY changed_at, id LIMIT ?",
        (before, most),
    ).fetchall()
