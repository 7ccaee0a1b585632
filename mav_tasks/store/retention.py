"""Deletes finished tasks with their events, and other old events, in bounded steps.

Events without a task are limited in number as well as in age: any sender can cause them. A task
that has not ended is never deleted, and neither are its events.
"""

from math import inf

from mav_tasks.settings import Retention
from mav_tasks.store.connection import Connection

STEP = 250  # tasks deleted in one transaction
SWEEP = 2_000  # journal rows examined in one transaction
MOST_OTHERS = 200_000  # events without a task: refusals, parameters, events of rovers

_OVER = "state >= 9"  # the terminal states; the same condition as the index's


class Trimmer:
    """Applies a Retention step by step, each step within the caller's transaction."""

    def __init__(self, retention: Retention) -> None:
        self._retention = retention
        self._swept = 0  # number of the last journal row examined

    def step(self, connection: Connection, *, utc: float, kept: str = "") -> bool:
        """Delete some rows that are too old or too many; return whether there may be more.

        ``kept``: a condition of tasks that stay, in SQL; "": there are none.
        """
        deleted = self._delete_tasks(connection, utc, f"NOT {kept}" if kept else "TRUE")
        others = self._delete_others(connection)
        return self._sweep(connection, utc) or deleted >= STEP or others >= SWEEP

    def _delete_tasks(self, connection: Connection, utc: float, free: str) -> int:
        ids: list[tuple[int]] = []
        if self._retention.max_age is not None:
            ids = _oldest(connection, STEP, before=utc - self._retention.max_age, free=free)
        if self._retention.max_count is not None:
            (count,) = connection.execute(f"SELECT count(*) FROM tasks WHERE {_OVER}").fetchone()
            excess = min(count - self._retention.max_count, STEP)
            if excess > len(ids):
                ids = _oldest(connection, excess, before=inf, free=free)
        if ids:
            connection.executemany("DELETE FROM journal WHERE task_id = ?", ids)
            connection.executemany("DELETE FROM tasks WHERE id = ?", ids)
        return len(ids)

    def _delete_others(self, connection: Connection) -> int:
        """Delete the oldest events without a task above MOST_OTHERS: a client could fill a disk."""
        query = "SELECT count(*) FROM journal WHERE task_id IS NULL"
        (count,) = connection.execute(query).fetchone()
        excess = min(count - MOST_OTHERS, SWEEP)
        if excess > 0:
            connection.execute(
                "DELETE FROM journal WHERE number IN (SELECT number FROM journal"
                " WHERE task_id IS NULL ORDER BY number LIMIT ?)",
                (excess,),
            )
        return int(max(excess, 0))

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


def _oldest(connection: Connection, most: int, *, before: float, free: str) -> list[tuple[int]]:
    return connection.execute(
        f"SELECT id FROM tasks WHERE {_OVER} AND changed_at < ? AND {free}"
        " ORDER BY changed_at, id LIMIT ?",
        (before, most),
    ).fetchall()
