"""A database that fails, hangs, restarts or changes its owner while a server writes to it."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.engine.inputs import Committed, StoreFailed
from mav_tasks.store import Store
from mav_tasks.tasks.events import TaskSubmitted
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until
from tests.kit.tcp_proxy import TcpProxy
from tests.unit.store.full_disk import fill
from tests.unit.store.postgres.gateways import hanging
from tests.unit.store.samples import (
    loaded,
    opened,
    submitted,
    wait_for,
    wait_for_failure,
)
from tests.unit.store.test_failures import child, kept, line


@pytest.fixture
def url(postgres: PostgresServer) -> str:
    return postgres.new_database()


@pytest.fixture
def proxy(postgres: PostgresServer) -> Iterator[TcpProxy]:
    with closing(TcpProxy(postgres.port)) as it:
        yield it


@contextmanager
def elsewhere(folder: Path) -> Iterator[None]:
    """Open stores as on another machine: with halt records of its own."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_DATA_HOME", str(folder))
        yield


def by_way_of(proxy: TcpProxy, url: str) -> str:
    """Return the URL of a database as it is reached through a proxy."""
    return f"postgresql://postgres@127.0.0.1:{proxy.port}/{name_of(url)}"


def name_of(url: str) -> str:
    return url.rpartition("/")[2]


def ids_in(url: str) -> list[int]:
    with connected(url) as connection:
        return [row[0] for row in connection.execute("SELECT id FROM tasks ORDER BY id")]


def check_whole(url: str, *, at_least: int) -> None:
    """Check that each event is there once, in its order, up to one that was reported at least."""
    with opened(url) as store:
        ids = [task.id for task in loaded(store).tasks]
        assert ids == list(range(1, len(ids) + 1))
        assert len(ids) >= at_least
        journal = list(store.journal())
        assert [number for number, _ in journal] == ids
        assert [e.task.id for _, e in journal if isinstance(e, TaskSubmitted)] == ids


def write_through(store: Store, numbers: Sequence[int], *, through: int) -> list[str]:
    """Append submissions, wait until they are kept; return the texts of failures until then."""
    store.append([submitted(number) for number in numbers])
    return [each.text for each in wait_for(store, through) if isinstance(each, StoreFailed)]


@pytest.mark.parametrize("way", ["stop", "kill"])
def test_a_restart_of_the_database_in_mid_write_loses_and_doubles_nothing(
    postgres: PostgresServer, url: str, way: str
) -> None:
    with child(url) as process:
        through = kept(process, at_least=100)
        for _ in range(2):
            getattr(postgres, way)()
            said = ""
            while not said.startswith("store"):
                said = line(process)
                through = int(said.split()[1]) if said.startswith("kept") else through
            assert said.startswith(f"store {url}: ")
            postgres.start()
            through = kept(process, at_least=through + 100)
    check_whole(url, at_least=through)


def test_a_database_that_hangs_in_mid_write_is_noticed_and_goes_on(
    postgres: PostgresServer, url: str
) -> None:
    with child(url) as process:
        through = kept(process, at_least=100)
        with postgres.frozen():
            said = ""
            while not said.startswith("store"):
                said = line(process)
                through = int(said.split()[1]) if said.startswith("kept") else through
            assert "no answer from the database within 3 s" in said
        through = kept(process, at_least=through + 100)
    check_whole(url, at_least=through)


def holders(postgres: PostgresServer, url: str) -> list[int]:
    """Return the processes of the database that have the fleet's lock."""
    found = postgres.execute(
        "SELECT pid FROM pg_locks WHERE locktype = 'advisory' AND granted AND classid = %s"
        " AND database = (SELECT oid FROM pg_database WHERE datname = %s)",
        (0x4D565453, name_of(url)),
    )
    return [row[0] for row in found]


def end_sessions(postgres: PostgresServer, url: str) -> None:
    """End the sessions of a database, as an operator can, and wait until they are gone."""
    query = (
        "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity"
        " WHERE datname = %s AND backend_type = 'client backend'"
    )
    wait_until(
        lambda: postgres.execute(query, (name_of(url),)) == [(0,)], within=10, what="no session"
    )


def test_an_answer_that_is_lost_after_the_commit_is_found_out(url: str, proxy: TcpProxy) -> None:
    with opened(by_way_of(proxy, url)) as store:
        write_through(store, [1], through=1)
        with hanging(url) as hang:
            store.append([submitted(2)])
            wait_until(hang.is_waited_for, within=10, what="a write under way")
            proxy.fall_silent()
        (told,) = write_through(store, [3], through=3)
        assert "no answer from the database within 3 s" in told
    check_whole(url, at_least=3)


@pytest.mark.parametrize(
    ("spoil", "mend", "words"),
    [
        (
            "ALTER TABLE tasks OWNER TO postgres",
            "ALTER TABLE tasks OWNER TO pilot",
            "the role lacks a right",
        ),
        (
            "ALTER TABLE tasks RENAME TO hidden",
            "ALTER TABLE hidden RENAME TO tasks",
            "a table is gone",
        ),
        (
            "ALTER SCHEMA mav_tasks RENAME TO hidden",
            "ALTER SCHEMA hidden RENAME TO mav_tasks",
            "a table is gone",
        ),
    ],
)
def test_rights_and_tables_that_are_taken_away_refuse_and_come_back(
    postgres: PostgresServer, url: str, spoil: str, mend: str, words: str
) -> None:
    postgres.execute("CREATE ROLE pilot LOGIN")
    postgres.execute(f"ALTER DATABASE {name_of(url)} OWNER TO pilot")
    try:
        with opened(url.replace("postgres@", "pilot@")) as store:
            write_through(store, [1], through=1)
            with connected(url) as other:
                other.execute(spoil)
                store.append([submitted(2)])
                assert words in wait_for_failure(store).text
                other.execute(f"SET search_path = mav_tasks, hidden; {mend}")
            wait_for(store, 2)
        assert ids_in(url) == [1, 2]
    finally:
        postgres.execute(f"DROP DATABASE {name_of(url)} WITH (FORCE)")
        postgres.execute("DROP ROLE pilot")


def test_a_full_disk_is_told_and_nothing_is_lost_over_it(postgres: PostgresServer) -> None:
    disk = postgres.folder / "disk"
    disk.mkdir()
    options = f"size=24m,uid={postgres.owner},gid={postgres.owner}"
    mount = ["mount", "-t", "tmpfs", "-o", options, "none", str(disk)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        disk.rmdir()
        pytest.skip("this user may not make a small file system")
    try:
        postgres.execute(f"CREATE TABLESPACE small LOCATION '{disk}'")
        postgres.execute("CREATE DATABASE cramped TABLESPACE small")
        url = postgres.url("cramped")
        try:
            with opened(url) as store:
                write_through(store, [1], through=1)
                fill(disk / "filler")
                store.append([submitted(number) for number in range(2, 2002)])
                told = wait_for_failure(store)
                assert "the disk of the database is full" in told.text
                (disk / "filler").unlink()
                wait_for(store, 2001)
            check_whole(url, at_least=2001)
        finally:
            postgres.execute("DROP DATABASE cramped WITH (FORCE)")
            postgres.execute("DROP TABLESPACE small")
    finally:
        subprocess.run(["umount", str(disk)], check=True)
        disk.rmdir()


def test_an_older_copy_in_the_place_of_the_database_is_not_written_to(
    postgres: PostgresServer, url: str
) -> None:
    with opened(url) as store:
        write_through(store, [1, 2, 3], through=3)
        with connected(url) as other:
            other.execute("UPDATE meta SET last_number = 2")
            other.execute("DELETE FROM tasks WHERE id = 3")
        end_sessions(postgres, url)
        store.append([submitted(4)])
        told = wait_for_failure(store)
        assert "it lacks events that it had stored (it has 2, this server stored 3)" in told.text
        assert ids_in(url) == [1, 2]
        with connected(url) as other:
            other.execute("UPDATE meta SET last_number = 3")
        wait_for(store, 4)


def test_a_server_that_was_replaced_stores_nothing_any_more(
    postgres: PostgresServer, url: str, proxy: TcpProxy, tmp_path: Path
) -> None:
    with opened(by_way_of(proxy, url)) as old:
        write_through(old, [1], through=1)
        with proxy.refusing():
            wait_until(lambda: not holders(postgres, url), within=10, what="the lock's release")
            with elsewhere(tmp_path / "b"), opened(url) as new:
                write_through(new, [2], through=1)
        old.append([submitted(3)])
        told = ""
        while "has taken the database over" not in told:  # before: refused by the proxy
            told = wait_for_failure(old).text
        assert f"pid {os.getpid()}, since " in told
        assert told.endswith("this server can store nothing any more; end it")
        with elsewhere(tmp_path / "b"), opened(url) as again:  # the old one holds no lock
            write_through(again, [4], through=1)
    assert ids_in(url) == [1, 2, 4]


def test_the_fence_alone_keeps_a_stale_server_out(url: str) -> None:
    with opened(url) as old:
        write_through(old, [1], through=1)
        with connected(url) as other:  # the next server, if the lock had failed
            other.execute("UPDATE writer SET epoch = epoch + 1, host = 'rock', pid = 7, since = 0")
        old.append([submitted(2)])
        told = wait_for_failure(old).text
        assert "the server on rock, pid 7, since 1970-01-01 00:00:00Z has taken" in told
    assert ids_in(url) == [1]


def test_a_server_that_was_suspended_and_wakes_up_stores_nothing_any_more(
    postgres: PostgresServer, url: str, tmp_path: Path
) -> None:
    with child(url) as process:
        kept(process, at_least=50)
        process.send_signal(signal.SIGSTOP)
        end_sessions(postgres, url)  # as its time limits do
        with elsewhere(tmp_path / "b"), opened(url) as store:
            number = max(task.id for task in loaded(store).tasks)
            write_through(store, [number + 1], through=1)
            journal = list(store.journal())
            process.send_signal(signal.SIGCONT)
            while "has taken the database over" not in line(process):
                pass
            assert list(store.journal()) == journal
            write_through(store, [number + 2], through=2)
    assert ids_in(url) == list(range(1, number + 3))


def test_a_store_is_no_reason_to_import_psycopg() -> None:
    code = (
        "import sys; import mav_tasks.shell.serve; from mav_tasks.store import open_store;"
        " open_store(':memory:'); print('psycopg' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_standby_that_must_confirm_and_does_not_is_waited_for(
    postgres: PostgresServer, url: str
) -> None:
    with opened(url) as store:
        write_through(store, [1], through=1)
        standbys(postgres, "nobody")
        try:
            store.append([submitted(2)])
            (waiting,) = wait_until(
                lambda: waiters(postgres), within=10, what="a commit that waits"
            )
            postgres.execute("SELECT pg_cancel_backend(%s)", waiting)
            told = wait_for_failure(store)
            assert "not confirmed by the database: canceling wait for synchronous" in told.text
            store.append([submitted(3)])
            wait_until(lambda: waiters(postgres) not in ([], [waiting]), within=20, what="another")
            assert not any(isinstance(each, Committed) for each in store.take_outcomes())
        finally:
            standbys(postgres, "")
        wait_for(store, 3)
    check_whole(url, at_least=3)


def waiters(postgres: PostgresServer) -> list[Any]:
    """Return the processes whose commit waits for a replica."""
    query = "SELECT pid FROM pg_stat_activity WHERE wait_event = 'SyncRep'"
    return postgres.execute(query)


def standbys(postgres: PostgresServer, names: str) -> None:
    """Set which replicas must have each commit."""
    postgres.execute(f"ALTER SYSTEM SET synchronous_standby_names = '{names}'")
    postgres.execute("SELECT pg_reload_conf()")
    wait_until(
        lambda: postgres.execute("SHOW synchronous_standby_names") == [(names,)],
        within=10,
        what="the setting in force",
    )
