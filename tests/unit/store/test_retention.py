"""What is forgotten of the journal, in bounded steps."""

from collections.abc import Iterator
from typing import Any

import pytest

from mav_tasks.settings import Retention
from mav_tasks.store import retention
from mav_tasks.store.connection import Connection
from mav_tasks.store.retention import Trimmer
from tests.kit.databases import is_file
from tests.unit.store.samples import opened

NOW = 1.8e9


@pytest.fixture
def connection(place: str) -> Iterator[Connection]:
    """The connection of a store's own database."""
    with opened(place) as store:
        database: Any = store._database
        yield database._connection if is_file(place) else database._session


def note(connection: Connection, *numbers: int, task: int | None = None) -> None:
    connection.executemany(
        "INSERT INTO journal (number, utc, kind, task_id, vehicle, body)"
        " VALUES (?, ?, 'x', ?, 1, '')",
        [(number, NOW, task) for number in numbers],
    )


def left(connection: Connection) -> list[int]:
    return [row[0] for row in connection.execute("SELECT number FROM journal ORDER BY number")]


def test_events_of_no_task_are_bounded_in_number(
    connection: Connection, monkeypatch: pytest.MonkeyPatch
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
