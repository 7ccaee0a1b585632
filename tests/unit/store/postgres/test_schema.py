"""The tables of a database: brought up to date, in whole or not at all."""

from contextlib import closing

import pytest

from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.schema import MIGRATIONS, migrate, version_of
from mav_tasks.store.postgres.session import Session
from tests.kit.postgres import PostgresServer


def session(url: str) -> Session:
    return Session(parse(url), purpose="test")


def test_an_older_schema_is_brought_up_to_date(postgres: PostgresServer) -> None:
    newer = (*MIGRATIONS, ("ALTER TABLE vehicles ADD COLUMN colour TEXT",))
    with closing(session(postgres.new_database())) as it:
        assert version_of(it) == 0
        migrate(it)
        it.execute("INSERT INTO vehicles (vehicle) VALUES (?)", (7,))
        migrate(it, migrations=newer)
        assert it.execute("SELECT vehicle, colour FROM vehicles").fetchall() == [(7, None)]
        versions = it.execute("SELECT version FROM versions ORDER BY version").fetchall()
        assert versions == [(number,) for number in range(1, len(newer) + 1)]
        with pytest.raises(PostgresError, match=f"schema {len(newer)}, this one knows"):
            migrate(it)


def test_a_migration_that_fails_changes_nothing(postgres: PostgresServer) -> None:
    with closing(session(postgres.new_database())) as it:
        with pytest.raises(PostgresError, match="syntax error"):
            migrate(it, migrations=(*MIGRATIONS, ("CREATE TABLE x (y TEXT)", "nonsense")))
        assert version_of(it) == len(MIGRATIONS)
        assert it.execute("SELECT to_regclass(?)", ("x",)).fetchall() == [(None,)]


def test_a_first_migration_that_fails_leaves_the_database_empty(postgres: PostgresServer) -> None:
    with closing(session(postgres.new_database())) as it:
        with pytest.raises(PostgresError, match="syntax error"):
            migrate(it, migrations=(("CREATE TABLE x (y TEXT)", "nonsense"),))
        assert version_of(it) == 0
        migrate(it)
        assert version_of(it) == len(MIGRATIONS)


def test_values_come_back_as_they_were(postgres: PostgresServer) -> None:
    values = (1 << 62, -0.1, 1e300, "ä\n'\"\\", None)
    with closing(session(postgres.new_database())) as it:
        found = it.execute(
            "SELECT ?::bigint, ?::double precision, ?::double precision, ?::text, ?::text", values
        )
        assert found.fetchone() == values
        assert found.fetchone() is None
        with pytest.raises(ValueError, match="zero byte"):
            it.execute("SELECT ?::text", ("a\0b",))
