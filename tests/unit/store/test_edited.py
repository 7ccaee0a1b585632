"""A file that somebody has edited is told in words, before a server uses it and while it does."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.store.base import Which
from mav_tasks.store.opening import kind_of
from tests.unit.store.samples import keep, loaded, opened, submitted, wait_for_failure

#: SQL, and what is said when the file is opened again, and read
BROKEN = {
    "UPDATE formats SET names = '{}'": "TaskSubmitted has another format",
    "UPDATE tasks SET submitted = replace(submitted, 'Move', 'Dance')": "does not know 'Dance'",
    "UPDATE tasks SET submitted = 'x'": "it is damaged (Expecting value",
    "DROP TABLE plans": "no such table: plans",
    "DROP TABLE writer": "a table has lost its row",
    "INSERT INTO vehicles (vehicle, paused) VALUES (1, 999)": "it is damaged (999 is not a valid",
}


def edit(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(statement)


def test_an_edited_file_is_refused_in_one_line_that_names_it(tmp_path: Path) -> None:
    for number, (statement, words) in enumerate(BROKEN.items()):
        path = tmp_path / f"{number}"
        with opened(path) as store:
            keep(store, submitted(1))
        edit(path, statement)
        with pytest.raises(StoreError) as told, opened(path) as store:
            loaded(store)
        assert str(told.value).startswith(f"store {path}: "), statement
        assert words in str(told.value)
    kind = kind_of("")
    with pytest.raises(StoreError, match="store ~nobody-here/x: "):
        kind.read_parameters("~nobody-here/x")
    empty = tmp_path / "empty"
    empty.touch()
    for path, words in ((empty, "it is empty"), (tmp_path / "none", "does not exist")):
        with pytest.raises(StoreError, match=words):
            kind.open_journal(str(path), Which())


def test_a_server_whose_file_is_edited_stores_nothing_more(tmp_path: Path) -> None:
    path = tmp_path / "tasks"
    with opened(path) as store:
        keep(store, submitted(1))
        edit(path, "UPDATE writer SET epoch = 99, host = 'b', pid = 7")
        store.append([submitted(3)])
        assert "on b, pid 7, since" in wait_for_failure(store).text
