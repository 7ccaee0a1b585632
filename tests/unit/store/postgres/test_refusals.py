"""Databases that a server cannot use: each is told in one line, which says what to do."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mav_tasks.errors import StoreError
from mav_tasks.store.base import Which
from mav_tasks.store.opening import kind_of
from tests.kit.postgres import PostgresServer
from tests.kit.processes import free_tcp_ports
from tests.unit.store.samples import opened, submitted, wait_for


def refusal(url: str) -> str:
    with pytest.raises(StoreError) as told:
        opened(url).__enter__()
    text = str(told.value)
    assert "\n" not in text
    assert "secret" not in text
    return text


@contextmanager
def role(server: PostgresServer, name: str, options: str = "") -> Iterator[str]:
    server.execute(f"CREATE ROLE {name} LOGIN {options}")
    try:
        yield name
    finally:
        for (database,) in server.execute("SELECT datname FROM pg_database WHERE datallowconn"):
            server.execute(f"DROP OWNED BY {name} CASCADE", database=database)
        server.execute(f"DROP ROLE {name}")


def name_of(url: str) -> str:
    return url.rpartition("/")[2]


def test_an_unknown_host() -> None:
    text = refusal("postgresql://anna:secret@nowhere.invalid/fleet")
    assert text.startswith("store postgresql://anna@nowhere.invalid/fleet: failed to resolve host")
    assert text.endswith("check the host's name in the URL")


def test_what_is_no_host_no_service_and_no_option() -> None:
    assert "the host's name is not valid" in refusal("postgresql://a..b/fleet")
    assert 'definition of service "none" not found' in refusal("postgresql:///?service=none")
    assert "connect_timeout" in refusal("postgresql://127.0.0.1/fleet?connect_timeout=x")


def test_nobody_listens() -> None:
    (port,) = free_tcp_ports(1)
    assert "is the server running there?" in refusal(f"postgresql://127.0.0.1:{port}/fleet")
    assert "is the server running there?" in refusal("postgresql:///fleet?host=/nowhere/at/all")


def test_a_database_and_a_role_that_do_not_exist(postgres: PostgresServer) -> None:
    assert "create it: createdb" in refusal(postgres.url("nothing"))
    assert "create it: createuser" in refusal(postgres.url("postgres", role="nobody_at_all"))


def test_a_wrong_password_and_none(
    postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = postgres.new_database()
    with role(postgres, "guarded", "PASSWORD 'right secret'") as name:
        postgres.execute(f"GRANT CREATE ON DATABASE {name_of(url)} TO {name}")
        wrong = url.replace("postgres@", f"{name}:wrong%20secret@")
        assert "password authentication failed for user" in refusal(wrong)
        assert "check ~/.pgpass, PGPASSWORD or the URL" in refusal(wrong)
        without = url.replace("postgres@", f"{name}@")
        assert "put it into ~/.pgpass or PGPASSWORD" in refusal(without)
        right = url.replace("postgres@", f"{name}:right%20secret@")
        with opened(right) as store:
            assert store.name == store.place == without
            assert "secret" not in repr(store)
        monkeypatch.setenv("PGPASSWORD", "right secret")
        with opened(without) as store:
            assert store.load().ended_well


def test_a_password_file_is_used(
    postgres: PostgresServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = postgres.new_database()
    with role(postgres, "guarded", "PASSWORD 'right secret'") as name:
        postgres.execute(f"GRANT CREATE ON DATABASE {name_of(url)} TO {name}")
        (tmp_path / "pgpass").write_text(f"*:*:*:{name}:right secret\n", encoding="ascii")
        (tmp_path / "pgpass").chmod(0o600)
        monkeypatch.setenv("PGPASSFILE", str(tmp_path / "pgpass"))
        with opened(url.replace("postgres@", f"{name}@")) as store:
            assert store.load().ended_well


def test_a_role_that_may_not_create_the_schema(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with role(postgres, "plain") as name:
        theirs = url.replace("postgres@", f"{name}@")
        assert "permission denied for database" in refusal(theirs)
        assert "GRANT CREATE ON DATABASE" in refusal(theirs)
        postgres.execute(f"CREATE SCHEMA mav_tasks AUTHORIZATION {name}", database=name_of(url))
        with opened(theirs) as store:
            store.append([submitted(1)])
            wait_for(store, 1)


def test_another_roles_schema(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with opened(url) as store:
        store.append([submitted(1)])
    with role(postgres, "plain") as name:
        text = refusal(url.replace("postgres@", f"{name}@"))
        assert "use the role that owns the schema mav_tasks" in text


def test_a_role_that_may_only_read_reads_the_journal_and_serves_nothing(
    postgres: PostgresServer,
) -> None:
    url = postgres.new_database()
    with opened(url) as store:
        store.append([submitted(1)])
    with role(postgres, "reader") as name:
        theirs = url.replace("postgres@", f"{name}@")
        for grant in ("USAGE ON SCHEMA mav_tasks", "SELECT ON ALL TABLES IN SCHEMA mav_tasks"):
            postgres.execute(f"GRANT {grant} TO {name}", database=name_of(url))
        journal = kind_of(theirs).open_journal(theirs, Which())
        assert [number for number, _ in journal.take(offset=0.0)] == [1]
        journal.close()
        assert "permission denied" in refusal(theirs)
        postgres.execute(f"ALTER ROLE {name} SET default_transaction_read_only = on")
        assert "read-only for this role" in refusal(theirs)


def test_a_replica_is_refused_and_read(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with opened(url) as store:
        store.append([submitted(1)])
    with postgres.as_replica():
        assert "it is a replica, or the server is in recovery" in refusal(url)
        journal = kind_of(url).open_journal(url, Which())
        assert [number for number, _ in journal.take(offset=0.0)] == [1]
        journal.close()
    with opened(url) as store:
        assert len(store.load().tasks) == 1


def test_an_old_server(postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mav_tasks.store.postgres.session.OLDEST", 990_000)
    text = refusal(postgres.new_database())
    assert text.endswith("is too old: use version 99 or a newer one")


def test_too_many_connections(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    postgres.execute(f"ALTER DATABASE {name_of(url)} CONNECTION LIMIT 0")
    with role(postgres, "plain") as name:
        text = refusal(url.replace("postgres@", f"{name}@"))
    assert text.endswith("too many connections: end some, or raise max_connections of the server")


def test_a_server_that_says_nothing(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with postgres.frozen():
        assert "timeout expired: check host and port in the URL" in refusal(url)


def test_a_journal_of_a_database_without_a_store(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    assert kind_of(url).read_parameters(url) == {}
    with pytest.raises(StoreError, match="there is no store in it yet"):
        kind_of(url).open_journal(url, Which())


def test_a_folder_for_the_record_of_halts_that_cannot_be_made(
    postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = postgres.new_database()
    with monkeypatch.context() as elsewhere:
        elsewhere.setenv("XDG_DATA_HOME", "/proc/nowhere")
        assert "/proc/nowhere/mav-tasks cannot be created" in refusal(url)
    with opened(url) as store:  # nothing of the refused store holds on to the lock
        assert store.load().ended_well
