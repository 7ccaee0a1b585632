"""What only a store in a SQLite file has: its files, and the migrations of older ones."""

import sqlite3
import stat
from pathlib import Path

import pytest

from mav_tasks.store.schema import APPLICATION_ID, MIGRATIONS, migrate
from tests.unit.store.samples import opened, submitted, wait_for


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "tasks.sqlite3"


def test_a_file_of_the_first_schema_is_read(path: Path) -> None:
    path.parent.mkdir(parents=True)
    connection = sqlite3.connect(path, isolation_level=None)
    migrate(connection, migrations=MIGRATIONS[:1])
    connection.close()
    with opened(path) as store:
        store.append([submitted(1)])
    with opened(path) as store:
        assert [task.id for task in store.load().tasks] == [1]


def test_files_are_their_users_alone(path: Path) -> None:
    with opened(path) as store:
        store.append([submitted(1)])
        wait_for(store, 1)
        modes = {entry.name: stat.S_IMODE(entry.stat().st_mode) for entry in path.parent.iterdir()}
    assert set(modes.values()) == {0o600}
    assert set(modes) >= {"tasks.sqlite3", "tasks.sqlite3.halts", "tasks.sqlite3-wal"}
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_an_older_schema_is_brought_up_to_date() -> None:
    connection = sqlite3.connect(":memory:", isolation_level=None)
    newer = (*MIGRATIONS, ("ALTER TABLE vehicles ADD COLUMN colour TEXT",))
    migrate(connection)
    connection.execute("INSERT INTO vehicles (vehicle) VALUES (7)")
    migrate(connection, migrations=newer)
    assert connection.execute("SELECT vehicle, colour FROM vehicles").fetchall() == [(7, None)]
    assert connection.execute("PRAGMA user_version").fetchone() == (len(newer),)
    connection.close()


def test_a_migration_that_fails_changes_nothing() -> None:
    connection = sqlite3.connect(":memory:", isolation_level=None)
    with pytest.raises(sqlite3.OperationalError):
        migrate(connection, migrations=(*MIGRATIONS, ("CREATE TABLE x (y)", "nonsense")))
    assert connection.execute("PRAGMA user_version").fetchone() == (len(MIGRATIONS),)
    assert connection.execute("SELECT name FROM sqlite_master WHERE name = 'x'").fetchone() is None
    assert connection.execute("PRAGMA application_id").fetchone() == (APPLICATION_ID,)
    connection.close()
