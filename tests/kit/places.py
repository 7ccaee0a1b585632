"""A fixture: the place of a store that does not exist yet, of each durable kind in turn."""

from pathlib import Path

import pytest

from tests.kit.postgres import PostgresServer


@pytest.fixture(params=["sqlite", "postgres"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The place of a store that does not exist yet."""
    if request.param == "sqlite":
        return str(tmp_path / "folder" / "tasks.sqlite3")
    server = request.getfixturevalue("postgres")
    assert isinstance(server, PostgresServer)
    return server.new_database()
