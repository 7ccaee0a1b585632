"""What is in the databases of stores, for SQL that both kinds understand."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from tests.kit.postgres import connected


def is_file(place: str) -> bool:
    """Return whether a place is a SQLite file."""
    return "://" not in place


@contextmanager
def tables(place: str) -> Iterator[Any]:
    """Return a connection to the tables of a store; each statement commits itself."""
    opened = sqlite3.connect(place, isolation_level=None) if is_file(place) else connected(place)
    with closing(opened) as connection:
        yield connection


@contextmanager
def locked(place: str) -> Iterator[Any]:
    """Lock the tables, so that no server can write; return the connection, for ROLLBACK."""
    with tables(place) as connection:
        connection.execute("BEGIN IMMEDIATE" if is_file(place) else "BEGIN")
        if not is_file(place):
            connection.execute("LOCK TABLE writer IN ACCESS EXCLUSIVE MODE")
        yield connection


def newer(place: str) -> None:
    """Let a later version have written the store."""
    with tables(place) as connection:
        if is_file(place):
            connection.execute("PRAGMA user_version = 1000")
        else:
            connection.execute("INSERT INTO versions (version) VALUES (1000)")


def foreign(place: str) -> None:
    """Let another program have made a table there."""
    if is_file(place):
        Path(place).parent.mkdir(parents=True, exist_ok=True)
    with tables(place) as connection:
        if not is_file(place):
            connection.execute("CREATE SCHEMA mav_tasks")
        connection.execute("CREATE TABLE versions (version TEXT)")


def halts_of(place: str, folder: Path) -> Path:
    """Return the record of halts of a store that was opened; ``folder`` is the test's own."""
    if is_file(place):
        return Path(f"{place}.halts")
    (found,) = (folder / "data" / "mav-tasks").glob("*.halts")
    return found
