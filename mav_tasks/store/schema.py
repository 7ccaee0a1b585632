"""The tables of a store, and the migrations of older files.

``user_version`` counts the migrations applied to a file. A changed table, or a changed meaning of a
stored name (goal, state, field), needs a new migration at the end of the list; released migrations
are never edited. A new field, goal or event needs no migration: see ``codec``.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from mav_tasks.errors import StoreError

APPLICATION_ID = 0x4D565453  # "MVTS"; keeps us from writing to another program's database

#: each is the statements of one transaction. Times are UTC seconds, texts are rows of ``codec``.
MIGRATIONS: tuple[tuple[str, ...], ...] = (
    (
        f"PRAGMA application_id = {APPLICATION_ID}",
        (
            "CREATE TABLE meta (one INTEGER PRIMARY KEY CHECK (one = 1), next_id INTEGER NOT NULL,"
            " last_number INTEGER NOT NULL, last_write REAL, ended_well INTEGER NOT NULL)"
        ),
        "INSERT INTO meta VALUES (1, 1, 0, NULL, 1)",
        "CREATE TABLE formats (id INTEGER PRIMARY KEY, names TEXT NOT NULL UNIQUE)",
        # A submission's event is stored in the task's row: columns number and submitted.
        (
            "CREATE TABLE tasks (id INTEGER PRIMARY KEY, number INTEGER NOT NULL,"
            " vehicle INTEGER NOT NULL, state INTEGER NOT NULL, changed_at REAL NOT NULL,"
            " submitted TEXT NOT NULL, changed TEXT, modified TEXT)"
        ),
        "CREATE INDEX finished ON tasks (changed_at) WHERE state >= 9",
        (
            "CREATE TABLE journal (number INTEGER PRIMARY KEY, utc REAL NOT NULL,"
            " kind TEXT NOT NULL, task_id INTEGER, vehicle INTEGER, body TEXT NOT NULL)"
        ),
        "CREATE INDEX of_task ON journal (task_id) WHERE task_id IS NOT NULL",
        "CREATE TABLE vehicles (vehicle INTEGER PRIMARY KEY, paused INTEGER, uid TEXT, speed REAL)",
    ),
    ("ALTER TABLE tasks ADD COLUMN advanced TEXT",),  # the last leg that was started
    (
        (
            "CREATE TABLE plans (vehicle INTEGER NOT NULL, kind INTEGER NOT NULL,"
            " plan_id INTEGER NOT NULL, source TEXT NOT NULL, PRIMARY KEY (vehicle, kind))"
        ),
    ),
    ("CREATE TABLE parameters (name TEXT PRIMARY KEY, value REAL)",),
    (  # times of signatures, in 10 µs since 2015; keys by their fingerprints
        (
            "CREATE TABLE signatures (key TEXT NOT NULL, link_id INTEGER NOT NULL,"
            " system_id INTEGER NOT NULL, component_id INTEGER NOT NULL,"
            " timestamp INTEGER NOT NULL,"
            " PRIMARY KEY (key, link_id, system_id, component_id)) WITHOUT ROWID"
        ),
        "ALTER TABLE meta ADD COLUMN signed_until INTEGER NOT NULL DEFAULT 0",
    ),
    ("ALTER TABLE vehicles ADD COLUMN home TEXT",),  # not used any more
    ("ALTER TABLE vehicles ADD COLUMN halt_epoch INTEGER",),
    ("ALTER TABLE vehicles ADD COLUMN may_arm INTEGER",),  # 0: a client disarmed the vehicle
    (  # the last halt
        "ALTER TABLE vehicles ADD COLUMN halt_reason INTEGER",
        "ALTER TABLE vehicles ADD COLUMN halted_utc REAL",
    ),
    ("ALTER TABLE tasks ADD COLUMN assigned TEXT",),  # the last vehicle, if it was chosen again
    (  # the server that opened the file last; beats: random, per checkpoint; '': no name yet
        (
            "CREATE TABLE writer (one INTEGER PRIMARY KEY CHECK (one = 1), epoch INTEGER NOT NULL,"
            " host TEXT NOT NULL, pid INTEGER NOT NULL, since REAL NOT NULL,"
            " beats INTEGER NOT NULL)"
        ),
        "INSERT INTO writer VALUES (1, 0, '', 0, 0, 0)",
        "ALTER TABLE meta ADD COLUMN fleet TEXT NOT NULL DEFAULT ''",
    ),
    ("CREATE INDEX of_kind ON journal (kind, task_id)",),  # they are counted
)


def check(connection: sqlite3.Connection) -> None:
    """Raise StoreError if a database is another program's, or a newer version's."""
    version, known = _number(connection, "user_version"), len(MIGRATIONS)
    if _number(connection, "application_id") != APPLICATION_ID and (
        version or connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    ):
        raise StoreError("it is a database of another program")
    if version > known:
        raise StoreError(
            f"written by a newer version (schema {version}, this one knows {known}):"
            " install that version, or restore an older copy"
        )


def is_empty(connection: sqlite3.Connection) -> bool:
    """Whether a checked database has no table yet."""
    return _number(connection, "user_version") == 0


def migrate(
    connection: sqlite3.Connection, *, migrations: Sequence[Sequence[str]] = MIGRATIONS
) -> None:
    """Apply the missing migrations to a checked database."""
    for number in range(_number(connection, "user_version"), len(migrations)):
        with transaction(connection):
            for statement in migrations[number]:
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {number + 1}")


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Commit the block's changes, or roll them back if the block raises."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            with suppress(sqlite3.Error):  # the first error is the one to raise
                connection.execute("ROLLBACK")
        raise


def _number(connection: sqlite3.Connection, pragma: str) -> int:
    return int(connection.execute(f"PRAGMA {pragma}").fetchone()[0])
