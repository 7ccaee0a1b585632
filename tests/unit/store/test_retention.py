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


def note(
    connection: Connection, *numbers: int, task: int | None = None, kind: str = "VehicleHalted"
) -> None:
    connection.executemany(
        "INSERT INTO journal (number, utc, kind, task_id, vehicle, body)"
        " VALUES (?, ?, ?, ?, 1, '')",
        [(number, NOW, kind, task) for number in numbers],
    )


def left(connection: Connection) -> list[int]:
    return [row[0] for row in connection.execute("SELECT number FROM journal ORDER BY number")]


@pytest.fixture
def trimmer(monkeypatch: pytest.MonkeyPatch) -> Trimmer:
    """One that keeps ten events of a kind without a task, five of a task, twenty in all."""
    for name, most in (("NO_TASK", 10), ("TASK", 5), ("KIND", 20)):
        monkeypatch.setattr(retention, f"MOST_OF_{name}", most)
    monkeypatch.setattr(retention, "SWEEP", 4)
    return Trimmer(Retention(max_age=None, max_count=None))


def test_events_of_no_task_are_bounded_in_number(connection: Connection, trimmer: Trimmer) -> None:
    note(connection, *range(1, 19))
    note(connection, 100, 101, task=7)
    assert trimmer.step(connection, utc=NOW)
    assert left(connection)[0] == 5
    assert not trimmer.step(connection, utc=NOW)
    assert left(connection) == [*range(9, 19), 100, 101]


def test_refusals_push_out_no_halts(connection: Connection, trimmer: Trimmer) -> None:
    note(connection, *range(1, 9))
    note(connection, *range(10, 99), kind="SubmissionRefused")
    while trimmer.step(connection, utc=NOW):
        pass
    assert left(connection) == [*range(1, 9), *range(89, 99)]


def test_changes_of_one_task_push_out_only_its_own(
    connection: Connection, trimmer: Trimmer
) -> None:
    note(connection, 1, 2, 3, task=1, kind="TaskModified")
    note(connection, 4, 5, task=2, kind="TaskChanged")
    note(connection, *range(10, 99), task=2, kind="TaskModified")
    while trimmer.step(connection, utc=NOW):
        pass
    assert left(connection) == [1, 2, 3, 4, 5, *range(94, 99)]


def test_changes_of_many_tasks_are_bounded_in_all(connection: Connection, trimmer: Trimmer) -> None:
    for number in range(30):
        note(connection, number + 1, task=number, kind="TaskModified")
    while trimmer.step(connection, utc=NOW):
        pass
    assert left(connection) == [*range(11, 31)]
