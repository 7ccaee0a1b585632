"""Records of real runs: telemetry logs, and decisions that are replayed; real processes."""

import os
import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from mav_tasks.recording.reading import read
from tests.kit.bridges import Bridge, TcpFar, bridge
from tests.kit.commands import mav_tasks
from tests.kit.processes import Stand, after_a_restart, stand, submit, wait_for, wait_until

PERIOD = 0.05  # s, between setpoints
LATE = 0.9  # s, after which a task would be held; a try to write comes once a second


def packets_of(folder: Path) -> list[Any]:
    """What pymavlink reads in all telemetry logs of a folder."""
    found = []
    for path in sorted(folder.glob("*.tlog"), key=lambda p: (len(p.name), p.name)):
        with closing(mavutil.mavlink_connection(str(path))) as log:
            while (message := log.recv_msg()) is not None:
                found.append(message)
    return found


def drive(running: Stand, distance: float) -> None:
    """Drive a move to its end."""
    link = running.connect()
    task = submit(link, 54000, distance)
    wait_for(link, "STATUSTEXT", f"'Task {task} done' in STATUSTEXT.text", within=20)


def over_tcp(made: list[Bridge]) -> Callable[[int], AbstractContextManager[str]]:
    """A way on which what comes may be cut anywhere; gives the bridge, too."""

    @contextmanager
    def way(rover_port: int) -> Iterator[str]:
        far: Any = TcpFar()
        with bridge(rover_port, far) as it:
            made.append(it)
            yield it.url

    return way


@contextmanager
def no_more_than(running: Stand, size: int) -> Iterator[None]:
    """No file of the server can grow beyond so many bytes while the block runs."""
    process = running.server.popen.pid
    soft, hard = resource.prlimit(process, resource.RLIMIT_FSIZE)
    resource.prlimit(process, resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.prlimit(process, resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.slow
def test_a_full_disk_holds_up_neither_the_task_nor_the_setpoints(tmp_path: Path) -> None:
    bridges: list[Bridge] = []
    logs = tmp_path / "logs"
    with stand(tmp_path, "--tlog", str(logs), way=over_tcp(bridges)) as running:
        log = running.server.output
        wait_until(
            lambda: sum(p.stat().st_size for p in logs.iterdir()) > 2 * log.stat().st_size + 4_000,
            within=20,
            what="a log longer than what the server says",
        )
        with no_more_than(running, log.stat().st_size + 4_000):
            drive(running, 1.0)
        running.server.wait_for(r"writing again; \d+ packets lost", within=5)
        running.server.end()
    said = running.server.text
    assert said.count("packets are being lost: File too large") == 1
    assert said.count("writing again;") == 1
    times = bridges[0].setpoints
    gaps = [after - before for before, after in pairwise(times)]
    assert len(gaps) > 30
    assert median(gaps) == pytest.approx(PERIOD, abs=0.01)
    assert max(gaps) < LATE  # the machine's own hiccups are in it
    kinds = [packet.get_type() for packet in packets_of(logs)]
    assert "BAD_DATA" not in kinds
    assert len(kinds) > 50


def replayed(record: Path) -> tuple[int, str]:
    """The exit code of a replay with other hashes, and what it prints."""
    done = mav_tasks("replay", str(record), PYTHONHASHSEED="12345")
    return done.status, done.output + done.error


def submissions_in(record: Path) -> int:
    """How many tasks were submitted, as far as is written yet."""
    return sum(entry.raw.count(b'"TaskSubmitted"') for entry in read(record).entries())


@pytest.mark.slow
def test_a_killed_run_and_the_one_after_it_are_replayed(tmp_path: Path) -> None:
    """The second one begins with what the first one left in the store."""
    records, store = tmp_path / "records", str(tmp_path / "tasks.sqlite3")
    options = ("--store", store, "--record", str(records))
    with stand(tmp_path, *options) as running:
        link = running.connect()
        running.drive(link, 5.0)
        submit(link, 54001, 45.0)
        (first,) = records.iterdir()
        assert f"record of decisions {first}" in running.server.text
        wait_until(lambda: submissions_in(first) == 2, within=20, what="both in the record")
        running.server.end(signal.SIGKILL)
    with stand(tmp_path, *options, way=over_tcp([])) as running:
        link = running.connect()
        after_a_restart()
        submit(link, 54013, 1, 2)
        submit(link, 193, 1)
        wait_for(link, "STATUSTEXT", "'Task 2 done' in STATUSTEXT.text", within=20)
        running.server.end()
    (second,) = set(records.iterdir()) - {first}
    code, words = replayed(first)
    assert code == 0, words
    assert "task 1 executing" in words
    assert "the record's end is missing: replayed up to its last whole line" in words
    code, words = replayed(second)
    assert code == 0, words
    assert "task 2 completed" in words
    assert "server stopped: no rover is being driven" in words
    assert "end is missing" not in words
    restored = read(second).restored
    assert restored is not None
    assert [task.id for task in restored.tasks] == [1, 2]
