"""Real processes on loopback UDP, stock pymavlink as the client: a rover drives, and stops."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.databases import tables
from tests.kit.processes import Stand, stand, submit, wait_for, wait_until

HOLD = 4
SETPOINT_TIMEOUT = 3.0  # s, ArduPilot's, after which the rover stops by itself
BRAKING = 2.0  # s, from driving to standing


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Stand]:
    with stand(tmp_path) as it:
        yield it


def test_a_command_of_stock_pymavlink_drives_the_rover_and_is_told_the_end(running: Stand) -> None:
    link = running.connect()
    start = running.truth()[-1]

    task_id = submit(link, 54000, 1.0, 0, 0, 0, 0, 0, 9)

    assert task_id == 1
    wait_for(link, "STATUSTEXT", "'Task 1 done' in STATUSTEXT.text", within=30)
    end = running.truth()[-1]
    assert end["north"] - start["north"] == pytest.approx(1.0, abs=0.1)  # as it knows its place
    assert abs(end["forward_speed"]) < 0.1
    wait_for(link, "HEARTBEAT", f"HEARTBEAT.type==10 and HEARTBEAT.custom_mode=={HOLD}")
    wait_for(link, "HEARTBEAT", "HEARTBEAT.type==10 and not HEARTBEAT.base_mode & 128")


def test_the_rover_stops_by_itself_when_the_server_is_killed(running: Stand) -> None:
    running.drive(running.connect(), 50.0)

    running.server.end(signal.SIGKILL)

    killed_at = running.truth()[-1]["time"]
    wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")
    stood_at = running.truth()[-1]["time"]
    assert SETPOINT_TIMEOUT - 0.5 < stood_at - killed_at < SETPOINT_TIMEOUT + BRAKING
    _stays_put(running)


def test_an_orderly_end_stops_the_rover_at_once(running: Stand) -> None:
    running.drive(running.connect(), 50.0)
    asked_at = running.truth()[-1]["time"]

    took = running.server.end()

    assert running.server.popen.returncode == 0
    assert took < 2.5  # 1.6 s idle: it brakes, and must be seen to get nowhere
    wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")
    assert running.truth()[-1]["time"] - asked_at < SETPOINT_TIMEOUT  # not by the time-out
    heartbeat = wait_for(running.connect_to_rover(), "HEARTBEAT", "HEARTBEAT.type==10")
    assert heartbeat.custom_mode == HOLD
    assert "Traceback" not in running.server.text


def test_a_server_that_fails_within_stops_its_rover_first_and_ends_with_70(tmp_path: Path) -> None:
    """Its database refuses a row as none of its own would, which it can only take for a mistake."""
    store = str(tmp_path / "tasks.sqlite3")
    with stand(tmp_path, serve_store=store) as running:
        link = running.connect()
        running.drive(link, 50.0)
        with tables(store) as other:
            other.execute(
                "CREATE TRIGGER no BEFORE INSERT ON tasks BEGIN SELECT RAISE(ABORT, 'x'); END"
            )
        link.mav.command_long_send(1, 191, 54001, 0, 90.0, 0, 0, 0, 0, 0, 0)
        assert running.server.popen.wait(10) == 70
        failed_at = running.truth()[-1]["time"]
        wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")
        assert running.truth()[-1]["time"] - failed_at < BRAKING  # not by the time-out
        heartbeat = wait_for(running.connect_to_rover(), "HEARTBEAT", "HEARTBEAT.type==10")
        assert heartbeat.custom_mode == HOLD
        assert "internal error: stopping every vehicle and ending" in running.server.text


def _stays_put(running: Stand) -> None:
    """Watch for a second that nothing moves."""
    before = running.truth()[-1]
    wait_until(lambda: running.truth()[-1]["time"] > before["time"] + 1.0, within=5)
    after = running.truth()[-1]
    assert abs(after["north"] - before["north"]) < 0.005
    assert abs(after["east"] - before["east"]) < 0.005
    assert abs(after["yaw"] - before["yaw"]) < 0.01
