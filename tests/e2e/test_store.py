"""The store on a real disk that fails, is blocked, in use or damaged; real processes."""

import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from mav_tasks.tasks.lifecycle import TaskReason
from tests.kit.databases import locked, tables
from tests.kit.processes import (
    Stand,
    after_a_restart,
    command_long,
    free_udp_ports,
    stand,
    submit,
    wait_for,
    wait_until,
)

HOLD = 4
MOVE, STOP, CONTINUE, MODIFY = 54000, 54003, 193, 54012
TEMPORARILY_REJECTED, STORE_UNAVAILABLE = 1, 102
BLOCKED = 5.0  # s


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def running(tmp_path: Path, path: Path) -> Iterator[Stand]:
    with stand(tmp_path, "--store", str(path)) as it:
        yield it


@pytest.fixture
def serving(tmp_path: Path, place: str) -> Iterator[Stand]:
    """A server and a rover, on each kind of store."""
    with stand(tmp_path, "--store", place) as it:
        yield it


@contextmanager
def full_disk(running: Stand) -> Iterator[None]:
    """No file of the server can grow while the block runs."""
    process = running.server.popen.pid
    soft, hard = resource.prlimit(process, resource.RLIMIT_FSIZE)
    resource.prlimit(process, resource.RLIMIT_FSIZE, (1, hard))
    try:
        yield
    finally:
        resource.prlimit(process, resource.RLIMIT_FSIZE, (soft, hard))


def stored(place: str | Path) -> list[int]:
    """The ids of the tasks that are in a store."""
    with tables(str(place)) as connection:
        found = connection.execute("SELECT id FROM tasks ORDER BY id").fetchall()
        return [row[0] for row in found]


def hold_is_seen(link: Any) -> None:
    wait_for(link, "HEARTBEAT", f"HEARTBEAT.type==10 and HEARTBEAT.custom_mode=={HOLD}")


def test_a_full_disk_refuses_new_tasks_and_nothing_else(running: Stand, path: Path) -> None:
    link = running.connect()
    running.drive(link, 2.0)
    with full_disk(running):
        refused = command_long(link, MOVE, 1.0, 0, 0, 11)
        assert (refused.result, refused.result_param2) == (TEMPORARILY_REJECTED, STORE_UNAVAILABLE)
        again = command_long(link, MOVE, 1.0, 0, 0, 12)
        assert (again.result, again.result_param2) == (TEMPORARILY_REJECTED, STORE_UNAVAILABLE)
        wait_for(link, "STATUSTEXT", "'Task 1 done' in STATUSTEXT.text", within=20)
        command_long(link, STOP)
        hold_is_seen(link)
        command_long(link, CONTINUE, 1)
    taken = wait_until(
        lambda: (ack := command_long(link, MOVE, 0.2, 0, 0, 13)).result == 0 and ack,
        within=10,
        what="a task to be accepted again",
    )
    task = taken.result_param2
    wait_for(link, "STATUSTEXT", f"'Task {task} done' in STATUSTEXT.text", within=20)
    assert {1, task} <= set(stored(path))
    assert "the store works again" in running.server.text
    assert "Traceback" not in running.server.text


def test_stop_does_not_wait_for_a_blocked_store(serving: Stand, place: str) -> None:
    link = serving.connect()
    rover = serving.connect_to_rover()
    serving.drive(link, 50.0)
    with locked(place) as other:
        asked = monotonic()
        ack = command_long(link, STOP)
        answered = monotonic() - asked
        wait_for(rover, "HEARTBEAT", f"HEARTBEAT.type==10 and HEARTBEAT.custom_mode=={HOLD}")
        wait_until(lambda: serving.speed() < 0.01, within=5, what="the rover to stand")
        refused = command_long(link, MOVE, 1.0, 0, 0, 11)
        wait_until(lambda: monotonic() - asked > BLOCKED, within=2 * BLOCKED)
        other.execute("ROLLBACK")
    assert (ack.result, answered < 0.3) == (0, True)
    assert (refused.result, refused.result_param2) == (TEMPORARILY_REJECTED, STORE_UNAVAILABLE)
    wait_until(
        lambda: command_long(link, MOVE, 1.0, 0, 0, 12).result == 0, within=10, what="acceptance"
    )


def test_after_a_kill_the_acknowledged_task_is_held_and_can_be_finished(
    tmp_path: Path, place: str
) -> None:
    with stand(tmp_path, "--store", place) as running:
        link = running.connect()
        running.drive(link, 3.0)
        waiting = submit(link, 54001, 45.0)
        running.server.end(signal.SIGKILL)
        wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")
        stopped = running.truth()[-1]
        with restarted(running, tmp_path, place) as server_log:
            wait_until(lambda: "found" in server_log.read_text(), within=20, what="the rover")
            link = running.connect()
            hold_is_seen(link)
            at_once = command_long(link, CONTINUE, 1)
            assert (at_once.result, at_once.result_param2) == (
                TEMPORARILY_REJECTED,
                TaskReason.STALE,
            )
            after_a_restart()
            submit(link, CONTINUE, 1)  # the queue; what is held stays so
            wait_for(link, "STATUSTEXT", "'keeps task 1 on hold' in STATUSTEXT.text")
            another = 0, 0, 0, 0, 0, 2  # in param7: no repeat of the first
            assert command_long(link, CONTINUE, 1, *another).result != 0  # release it first
            continued = running.truth()[-1]
            submit(link, 54013, 1, 1)  # the remainder
            wait_for(link, "STATUSTEXT", "'Task 1 done' in STATUSTEXT.text", within=30)
            end = running.truth()[-1]
            text = f"'Task {waiting} done' in STATUSTEXT.text"
            wait_for(link, "STATUSTEXT", text, within=30)
    assert stopped["north"] > 0.1  # it had begun; where it stops depends on when the server died
    assert continued["north"] == pytest.approx(stopped["north"], abs=0.01)
    assert end["north"] == pytest.approx(3.0, abs=0.1)


@contextmanager
def restarted(running: Stand, folder: Path, place: str) -> Iterator[Path]:
    """Another server on the same store and ports."""
    log = folder / "restarted.log"
    with log.open("w") as sink, server(running.client_port, running.rover_port, place, sink) as it:
        try:
            yield log
        finally:
            it.send_signal(signal.SIGTERM)


@contextmanager
def server(
    client_port: int, rover_port: int, place: str, sink: Any = subprocess.PIPE
) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "mav_tasks.cli", "serve", "--no-push"]
    command += ["--client", f"udpin:127.0.0.1:{client_port}", "--store", place]
    command += ["--vehicle", f"udpout:127.0.0.1:{rover_port}"]
    it = subprocess.Popen(command, stdout=sink, stderr=subprocess.STDOUT, text=True)
    try:
        yield it
    finally:
        if it.poll() is None:
            it.terminate()
        it.wait(10)


def refusal(place: str) -> str:
    """What a server says that cannot use a store."""
    ports = free_udp_ports(2)
    with server(ports[0], ports[1], place) as it:
        said = it.communicate(timeout=20)[0]
        assert it.returncode == 2, said
    assert "Traceback" not in said
    return said.splitlines()[-1]


def test_a_store_in_use_is_refused_and_its_owner_named(serving: Stand, place: str) -> None:
    said = refusal(place)
    assert place in said
    assert f"pid {serving.server.popen.pid}" in said
