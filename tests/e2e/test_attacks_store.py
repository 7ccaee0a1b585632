"""Attack D8: a halt on a full disk, then the server is killed and starts again.

Processes are real. The disk is full for every file but the record of halts, whose blocks have been
its own since it was made: what that is like on a file system is in unit/store/test_halt_record.py.
"""

import resource
import signal
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.tasks.lifecycle import TaskReason
from tests.kit.processes import (
    Process,
    Stand,
    command_long,
    process,
    stand,
    submit,
    wait_for,
    wait_until,
)

MOVE, STOP, CONTINUE, ARM, CHANGE_SPEED = 54000, 54003, 193, 400, 178
AUTOPILOT, SERVER = (1, 1), (1, 191)
FAILED = 4  # MAV_RESULT
Halt = tuple[int, tuple[float, ...], tuple[int, int]]
#: command, parameters and target of what was acknowledged before it was kept
HALTS: dict[str, Halt] = {"STOP": (STOP, (), SERVER), "disarming": (ARM, (0,), AUTOPILOT)}
DELAY = 6.0  # s, until the task that waits would drive
GOES_ON = ("--set", "rules.on_restart=continue")
NO_FILE_AT_ALL = 1  # byte
RECORD = 163_904  # bytes, of the record of halts
MOST = 2_000  # changes that fill SQLite's log: as many as a slow disk takes into one transaction


def limit_files(running: Stand, largest: int) -> None:
    """Let no write of the server go beyond this many bytes of a file."""
    _, hard = resource.prlimit(running.server.popen.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(running.server.popen.pid, resource.RLIMIT_FSIZE, (largest, hard))


def use_log(link: Any, path: Path) -> None:
    """Let SQLite write further back in its log than the record of halts is long.

    It starts the log over once the tables are made: only a log that grows is written at its end.
    """
    log = path.with_name(f"{path.name}-wal")
    enough = max(RECORD, log.stat().st_size)
    for number in range(MOST):
        if log.stat().st_size > enough:
            return
        assert command_long(link, CHANGE_SPEED, 1, 0.5 + number % 50 / 100).result == 0
    raise AssertionError(f"the log has {log.stat().st_size} bytes only")


def is_latched(path: Path) -> bool:
    """Whether the latch of STOP is in the database."""
    return row_of(path, "SELECT paused FROM vehicles WHERE vehicle = 1") == (TaskReason.STOPPED,)


def row_of(path: Path, query: str) -> tuple[object, ...]:
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as file:
        return tuple(file.execute(query).fetchone() or ())


@contextmanager
def restarted(running: Stand, folder: Path, *options: str) -> Iterator[Process]:
    """Run another server on the same store and ports."""
    serve = ["-m", "mav_tasks.cli", "serve", "--no-push", *options]
    serve += ["--client", f"udpin:127.0.0.1:{running.client_port}"]
    serve += ["--vehicle", f"udpout:127.0.0.1:{running.rover_port}"]
    serve += ["--store", str(folder / "tasks.sqlite3")]
    with process(*serve, folder=folder, name="second") as server:
        server.wait_for("rover 1: found")
        yield server


@pytest.mark.parametrize("halt", HALTS.values(), ids=HALTS)
def test_a_halt_outlives_the_end_of_the_server_just_after_its_acknowledgement(
    tmp_path: Path, halt: Halt
) -> None:
    path = tmp_path / "tasks.sqlite3"
    with stand(tmp_path, *GOES_ON, serve_store=str(path)) as running:
        link = running.connect()
        use_log(link, path)
        submit(link, MOVE, 5.0, 0, 0, 11, 0, DELAY)
        limit_files(running, RECORD)
        command, params, target = halt
        assert command_long(link, command, *params, target=target).result == 0
        running.server.end(signal.SIGKILL)
        with restarted(running, tmp_path, *GOES_ON):
            began = running.truth()[-1]
            wait_until(
                lambda: running.truth()[-1]["time"] > began["time"] + DELAY + 4.0,
                within=30,
                what="the time at which it would have driven",
            )
            assert running.truth()[-1]["north"] == pytest.approx(began["north"], abs=0.01)
            if command == STOP:
                refused = command_long(running.connect(), ARM, 1, target=AUTOPILOT)
                assert (refused.result, refused.result_param2) == (1, TaskReason.STOPPED)
            assert command_long(running.connect(), CONTINUE, 1).result == 0  # the way out
            wait_until(lambda: running.speed() > 0.2, within=15, what="the rover to drive")


def test_a_continue_outlives_a_full_disk_too(tmp_path: Path) -> None:
    path = tmp_path / "tasks.sqlite3"
    with stand(tmp_path, *GOES_ON, serve_store=str(path)) as running:
        link = running.connect()
        use_log(link, path)
        assert command_long(link, STOP).result == 0
        wait_until(lambda: is_latched(path), within=5, what="the latch on the disk")
        limit_files(running, RECORD)
        assert command_long(link, CONTINUE, 1).result == 0
        wait_until(lambda: "the disk" in running.server.text, within=5, what="the full disk")
        running.server.end(signal.SIGKILL)
        with restarted(running, tmp_path, *GOES_ON):
            submit(running.connect(), MOVE, 5.0)
            wait_until(lambda: running.speed() > 0.2, within=15, what="the rover to drive")


def test_a_stop_that_nothing_keeps_is_said_to_everybody(tmp_path: Path) -> None:
    path = tmp_path / "tasks.sqlite3"
    with stand(tmp_path, serve_store=str(path)) as running:
        link, other = running.connect(), running.connect(source_system=254)
        limit_files(running, NO_FILE_AT_ALL)
        ack = command_long(link, STOP)
        assert (ack.result, ack.result_param2) == (FAILED, TaskReason.STORE_UNAVAILABLE)
        for each in (link, other):
            wait_for(each, "STATUSTEXT", "'STOP in force but not stored' in STATUSTEXT.text")
        running.server.end(signal.SIGTERM)
    assert row_of(path, "SELECT ended_well FROM meta") == (0,)
