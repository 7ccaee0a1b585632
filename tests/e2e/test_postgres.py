"""A server with its store in PostgreSQL, which hangs, goes, comes back; real processes."""

import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.kit.commands import mav_tasks
from tests.kit.databases import tables
from tests.kit.postgres import PostgresServer
from tests.kit.processes import (
    Stand,
    command_long,
    free_udp_ports,
    process,
    stand,
    wait_for,
    wait_until,
)

HOLD = 4
MOVE, STOP, CONTINUE = 54000, 54003, 193
TEMPORARILY_REJECTED, STORE_UNAVAILABLE = 1, 102
REFUSED = (TEMPORARILY_REJECTED, STORE_UNAVAILABLE)


@contextmanager
def away(server: PostgresServer) -> Iterator[None]:
    """Let the database be stopped for a block."""
    server.stop()
    try:
        yield
    finally:
        server.start()


def test_without_its_database_the_server_refuses_new_tasks_and_nothing_else(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    url = postgres.new_database()
    with stand(tmp_path, serve_store=url) as running:
        link = running.connect()
        running.drive(link, 2.0)
        with away(postgres):
            for nonce in (11, 12):
                refused = command_long(link, MOVE, 1.0, 0, 0, nonce)
                assert (refused.result, refused.result_param2) == REFUSED
            running.server.wait_for("task 1 completed", within=20)
            running.server.wait_for(f"{re.escape(url)}: .*: new tasks are refused")
            assert command_long(link, STOP).result == 0
            wait_for(link, "HEARTBEAT", f"HEARTBEAT.type==10 and HEARTBEAT.custom_mode=={HOLD}")
            command_long(link, CONTINUE, 1)
        taken = wait_until(
            lambda: (ack := command_long(link, MOVE, 0.2, 0, 0, 13)).result == 0 and ack,
            within=20,
            what="a task to be accepted again",
        )
        task = taken.result_param2
        running.server.wait_for(f"task {task} completed", within=40)
        running.server.wait_for("the store works again")
    with tables(url) as connection:
        found = connection.execute("SELECT id FROM tasks ORDER BY id").fetchall()
        assert {1, task} <= {row[0] for row in found}
        numbers = connection.execute("SELECT count(*), count(DISTINCT number) FROM journal")
        assert len(set(numbers.fetchone())) == 1
    assert "Traceback" not in running.server.text


def test_a_stop_outlives_the_database_and_the_end_of_the_server(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    url = postgres.new_database()
    with stand(tmp_path, serve_store=url) as running:
        link = running.connect()
        running.drive(link, 50.0)
        with away(postgres):
            running.server.wait_for("new tasks are refused")
            assert command_long(link, STOP).result == 0
            wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")
            running.server.end(signal.SIGKILL)
        with serving_again(running, tmp_path, url):
            queue = mav_tasks("queue", server=f"udpout:127.0.0.1:{running.client_port}")
            assert "queue paused (STOP)" in queue.output, queue.output


@contextmanager
def serving_again(running: Stand, folder: Path, url: str) -> Iterator[None]:
    """Run another server on the same store and ports."""
    serve = ["-m", "mav_tasks.cli", "serve", "--no-push", "--store", url]
    serve += ["--client", f"udpin:127.0.0.1:{running.client_port}"]
    serve += ["--vehicle", f"udpout:127.0.0.1:{running.rover_port}"]
    with process(*serve, folder=folder, name="second") as server:
        server.wait_for("rover 1: found")
        yield


def test_a_database_that_is_made_as_the_guide_says_serves(
    tmp_path: Path, postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PGPORT", str(postgres.port))
    for what in ("DATABASE IF EXISTS fleet", "ROLE IF EXISTS rover"):  # of a run before this one
        postgres.execute(f"DROP {what}")
    create = {"PGHOST": "127.0.0.1", "PGUSER": "postgres"}
    for command in ("createuser rover", "createdb --owner=rover fleet"):
        postgres.run(*command.split(), **create)
    client, vehicle = free_udp_ports(2)
    options = ["--no-push", "--client", f"udpin:127.0.0.1:{client}"]
    options += ["--vehicle", f"udpout:127.0.0.1:{vehicle}"]
    for command, says in (
        ("serve --store postgresql://rover@localhost/fleet", "0 tasks"),
        (
            "serve --gateway north --store postgresql://rover@localhost/fleet",
            "as gateway north of its fleet",
        ),
    ):
        with process(
            "-m", "mav_tasks.cli", *command.split(), *options, folder=tmp_path, name=says
        ) as server:
            server.wait_for(f"store postgresql://rover@localhost/fleet, {says}")
            server.end()
            assert server.popen.returncode == 0
