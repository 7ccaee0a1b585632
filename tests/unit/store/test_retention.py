"""What is forgotten of the journal, in bounded steps."""

import sqlite3

import pytest

from mav_tasks.settings import Retention
from mav_tasks.store import retention
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.schema import migrate

NOW = 1.8e9


@pytest.fixture
def connection() -> sqlite3.Connection:
    made = sqlite3.connect(":memory:", isolation_level=None)
    migrate(made)
    return made


def note(connection: sqlite3.Connection, *numbers: int, task: int | None = None) -> None:
    connection.executemany(
        "INSERT INTO journal VALUES (?, ?, 'x', ?, 1, '')",
        [(number, NOW, task) for number in numbers],
    )


def left(connection: sqlite3.Connection) -> list[int]:
    return [row[0] for row in connection.execute("SELECT number FROM journal ORDER BY number")]


def test_events_of_no_task_are_bounded_in_number(
    connection: sqlite3.Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(retention, "MOST_OTHERS", 10)
    monkeypatch.setattr(retention, "SWEEP", 4)
    note(connection, *range(1, 19))
    note(connection, 100, 101, task=7)
    trimmer = Trimmer(Retention(max_age=None, max_count=None))
    assert trimmer.step(connection, utc=NOW)
    assert left(connection)[0] == 5
    assert trimmer.step(connection, utc=NOW)
    assert not trimmer.step(connection, utc=NOW)
    assert left(connection) == [*range(9, 19), 100, 101]
