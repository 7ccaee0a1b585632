"""Writes a batch with SQL that every kind of database understands, within a transaction."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import dumps, format_of
from mav_tasks.store.connection import Connection
from mav_tasks.tasks.events import Event

TASKS = ("id", "number", "vehicle", "state", "changed_at", "submitted")
JOURNAL = ("number", "utc", "kind", "task_id", "vehicle", "body")

_PLAN = (
    "INSERT INTO plans (vehicle, kind, plan_id, source) VALUES (?, ?, ?, ?)"
    " ON CONFLICT (vehicle, kind)"
    " DO UPDATE SET plan_id = excluded.plan_id, source = excluded.source"
)
_PARAMETER = (
    "INSERT INTO parameters (name, value) VALUES (?, ?)"
    " ON CONFLICT (name) DO UPDATE SET value = excluded.value"
)


class Insert(Protocol):
    """Inserts many rows at once, as the kind of database does it best.

    A task's id may be there: then the row replaces the older one.
    """

    def __call__(
        self, table: str, columns: Sequence[str], rows: Sequence[tuple[Any, ...]], /
    ) -> None: ...


def write_batch(connection: Connection, batch: Batch, *, insert: Insert, utc: float) -> None:
    """Write the rows of a batch, and note its last number and the time, UTC seconds."""
    write_rows(connection, batch, insert=insert)
    connection.execute(
        "UPDATE meta SET next_id = coalesce(?, next_id), last_number = ?, last_write = ?",
        (batch.next_id, batch.last, utc),
    )


def write_rows(connection: Connection, batch: Batch, *, insert: Insert) -> None:
    """Write the rows of a batch alone."""
    if batch.tasks:
        insert("tasks", TASKS, batch.tasks)
    if batch.journal:
        insert("journal", JOURNAL, batch.journal)
    for statement, rows in (
        ("UPDATE tasks SET state = ?, changed_at = ?, changed = ? WHERE id = ?", batch.changed),
        ("UPDATE tasks SET modified = ? WHERE id = ?", batch.modified),
        ("UPDATE tasks SET advanced = ? WHERE id = ?", batch.advanced),
        ("UPDATE tasks SET vehicle = ?, assigned = ? WHERE id = ?", batch.assigned),
        (_PLAN, batch.plans),
        (_PARAMETER, batch.parameters),
    ):
        if rows:  # an executemany without rows still takes time
            connection.executemany(statement, list(rows.values()))
    if batch.withdrawn:
        withdraw(connection, batch.withdrawn)
    for (column, vehicle), value in batch.vehicles.items():
        connection.execute(
            f"INSERT INTO vehicles (vehicle, {column}) VALUES (?, ?)"
            f" ON CONFLICT (vehicle) DO UPDATE SET {column} = excluded.{column}",
            (vehicle, value),
        )
    if batch.signatures:
        _keep_signatures(connection, batch.signatures)
    if batch.signed_until:
        connection.execute(
            "UPDATE meta SET signed_until = ? WHERE signed_until < ?",
            (batch.signed_until, batch.signed_until),
        )


def find_format(connection: Connection) -> int:
    """Return the number of this version's format; store it if it is new, within a transaction."""
    names = dumps(format_of(*Event.__args__))
    query = "SELECT id FROM formats WHERE names = ?"
    found = connection.execute(query, (names,)).fetchone()
    if found is None:
        connection.execute("INSERT INTO formats (names) VALUES (?)", (names,))
        found = connection.execute(query, (names,)).fetchone()
    return int(found[0])


def withdraw(connection: Connection, ids: Sequence[tuple[int]]) -> None:
    """Delete tasks, but keep their submissions in the journal."""
    connection.executemany(
        "INSERT INTO journal (number, utc, kind, task_id, vehicle, body)"
        " SELECT number, changed_at, 'TaskSubmitted', id, vehicle, submitted"
        " FROM tasks WHERE id = ?",
        ids,
    )
    connection.executemany("DELETE FROM tasks WHERE id = ?", ids)


def _keep_signatures(connection: Connection, times: Mapping[tuple[Any, ...], int | None]) -> None:
    gone = [sender for sender, time in times.items() if time is None]
    kept = [(*sender, time) for sender, time in times.items() if time is not None]
    if gone:
        connection.executemany(
            "DELETE FROM signatures"
            " WHERE key = ? AND link_id = ? AND system_id = ? AND component_id = ?",
            gone,
        )
    if kept:
        connection.executemany(
            "INSERT INTO signatures (key, link_id, system_id, component_id, timestamp)"
            " VALUES (?, ?, ?, ?, ?) ON CONFLICT (key, link_id, system_id, component_id)"
            " DO UPDATE SET timestamp = excluded.timestamp",
            kept,
        )
