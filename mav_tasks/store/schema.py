"""The tables of a SQLite file. ``user_version`` is the number of their schema; 0: no tables."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from mav_tasks.basics.errors import StoreError
from mav_tasks.store.tables import Tables

APPLICATION_ID = 0x4D565453  # "MVTS"; keeps us from writing to another program's database
TABLES = Tables("sqlite", 12, {"BIG": "INTEGER", "REAL": "REAL", "ID": "INTEGER", "EPOCH": ""})


def check(connection: sqlite3.Connection) -> None:
    """Raise StoreError if a database is another program's, or of a version that does not fit."""
    version = _number(connection, "user_version")
    if _number(connection, "application_id") != APPLICATION_ID and (
        version or connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    ):
        raise StoreError("it is a database of another program")
    if why := TABLES.refusal(version):
        raise StoreError(why)


def is_empty(connection: sqlite3.Connection) -> bool:
    """Whether a checked database has no table yet."""
    return _number(connection, "user_version") == 0


def migrate(connection: sqlite3.Connection) -> None:
    """Bring the tables of a checked database up to date."""
    found = _number(connection, "user_version")
    if found == TABLES.schema:
        return
    with transaction(connection):
        for statement in TABLES.statements(found):
            connection.execute(statement)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {TABLES.schema}")


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
