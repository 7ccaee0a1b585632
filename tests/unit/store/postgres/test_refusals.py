"""Databases that a server cannot use: each is told in one line, which says what to do."""

import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.store import Which, kind_of
from tests.kit.databases import foreign, tables
from tests.kit.postgres import PostgresServer
from tests.unit.store.postgres.gateways import Gateway
from tests.unit.store.samples import loaded, opened, submitted, wait_for


def refusal(url: str) -> str:
    with pytest.raises(StoreError) as told:
        opened(url).__enter__()
    text = str(told.value)
    assert "\n" not in text
    assert "secret" not in text.replace("gateway_secret", "")  # a table
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
            assert loaded(store).ended_well


def of_gateway(url: str) -> str:
    """Return the refusal of a gateway's lease."""
    with pytest.raises(StoreError) as told:
        Gateway(url, "a")
    return str(told.value)


def test_each_right_that_a_role_lacks_is_named(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with role(postgres, "plain") as name:
        theirs = url.replace("postgres@", f"{name}@")

        def sql(statement: str) -> None:
            postgres.execute(f"{statement} {name}", database=name_of(url))

        assert "may not create the schema mav_tasks: GRANT CREATE ON DATABASE" in refusal(theirs)
        postgres.execute("CREATE SCHEMA mav_tasks", database=name_of(url))
        sql("GRANT USAGE ON SCHEMA mav_tasks TO")
        assert "lacks CREATE on the schema: GRANT CREATE ON SCHEMA" in refusal(theirs)
        with opened(url):
            pass
        grant = "GRANT SELECT, INSERT, UPDATE, DELETE ON ALL TABLES IN SCHEMA mav_tasks TO"
        assert "SELECT on formats, gateway_secret, gateway_writes and 12 more;" in refusal(theirs)
        sql(grant)
        sql("REVOKE UPDATE, INSERT ON mav_tasks.journal FROM")
        sql("REVOKE UPDATE ON mav_tasks.holdings FROM")
        sql("REVOKE INSERT ON mav_tasks.versions FROM")  # is not needed
        for text in (refusal(theirs), of_gateway(theirs)):
            told = (
                f"INSERT on journal; UPDATE on holdings, journal; USAGE on gateway_epochs: {grant}"
            )
            assert f": the role plain lacks {told} plain, or use the role that owns" in text
        sql(grant)
        lacks = "lacks USAGE on gateway_epochs: GRANT USAGE ON ALL SEQUENCES IN SCHEMA mav_tasks TO"
        assert lacks in of_gateway(theirs)
        sql("GRANT USAGE ON ALL SEQUENCES IN SCHEMA mav_tasks TO")
        Gateway(theirs, "a").close()
        with opened(theirs) as store:
            store.append([submitted(1)])
            wait_for(store, 1)
        postgres.execute("UPDATE mav_tasks.versions SET version = 7", database=name_of(url))
        assert "must be converted by the role that owns its tables" in refusal(theirs)


def test_a_database_without_a_store_of_ours_is_not_read(
    postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    url, other = postgres.new_database(), postgres.new_database()
    foreign(other)
    for place, words in ((url, "no store in it yet"), (other, "tables of another program")):
        with pytest.raises(StoreError, match=words):
            kind_of(place).open_journal(place, Which())
    assert "tables of another program" in refusal(other)
    with tables(url) as first:  # a server that is about to make the tables
        first.execute(f"SELECT pg_advisory_lock({0x4D565453_00000001})")
        assert "in use by another server" in refusal(url)
        first.execute("SELECT pg_advisory_unlock_all()")
        opened(url).__enter__().close()
        first.execute("DELETE FROM writer")
        assert "a table has lost its row" in refusal(url)
        first.execute("DELETE FROM meta")
        assert "its table meta is empty" in refusal(url)
    monkeypatch.setenv("XDG_DATA_HOME", "/dev/null")
    assert "/dev/null/mav-tasks cannot be created" in refusal(postgres.new_database())


def test_a_database_of_a_newer_version(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with opened(url):
        pass
    add = "INSERT INTO mav_tasks.versions (version) VALUES (99)"
    postgres.execute(add, database=name_of(url))
    for text in (refusal(url), of_gateway(url)):
        assert "written by a newer version (schema 99, this one knows" in text
        assert text.endswith(": install that version here, too, or restore an older copy")


@pytest.mark.parametrize(
    ("where", "advice"),
    [
        ("DATABASE {0}", "ALTER DATABASE … RESET default_transaction_read_only"),
        ("ROLE plain", "ALTER ROLE … RESET default_transaction_read_only"),
        ("ROLE plain IN DATABASE {0}", "ALTER ROLE … IN DATABASE … RESET default_transaction"),
    ],
)
def test_a_read_only_database_is_told_with_what_makes_it_so(
    postgres: PostgresServer, where: str, advice: str
) -> None:
    url = postgres.new_database()
    with role(postgres, "plain") as name:
        postgres.execute(f"GRANT CREATE ON DATABASE {name_of(url)} TO {name}")
        set_it = f"ALTER {where.format(name_of(url))} SET default_transaction_read_only = on"
        postgres.execute(set_it)
        try:
            assert f"it is read-only: {advice}" in of_gateway(url.replace("postgres@", f"{name}@"))
        finally:  # or the role could not be removed
            postgres.execute(set_it.partition(" SET ")[0] + " RESET ALL")


def test_what_is_no_postgresql_server() -> None:
    """Some web server, for example, at that port."""
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor() as thread:

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(100)
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        thread.submit(answer)
        text = refusal(f"postgresql://127.0.0.1:{server.getsockname()[1]}/fleet")
    assert text.endswith("is PostgreSQL's port in the URL?")


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
        assert "lacks DELETE on formats, gateway_writes, gateways and 10 more; INSERT" in refusal(
            theirs
        )
        postgres.execute(f"ALTER ROLE {name} SET default_transaction_read_only = on")
        assert "it is read-only: ALTER ROLE … RESET default" in refusal(theirs)


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
        assert len(loaded(store).tasks) == 1


def test_too_many_connections(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    postgres.execute(f"ALTER DATABASE {name_of(url)} CONNECTION LIMIT 0")
    with role(postgres, "plain") as name:
        text = refusal(url.replace("postgres@", f"{name}@"))
    assert text.endswith("too many connections: end some, or raise max_connections of the server")
