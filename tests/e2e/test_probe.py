"""``mav-tasks probe`` with real processes: driven, ended midway, and what serve makes of it."""

import csv
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees
from pathlib import Path
from time import sleep

import pytest
from pymavlink import mavutil

from tests.e2e.test_usage import assert_one_clear_line, run
from tests.kit.processes import (
    Stand,
    environment_with,
    free_udp_ports,
    process,
    stand,
    submit,
    wait_until,
)

MOVE, ROTATE = 54000, 54001
OVER = 60  # s
STOOD_STILL = r"a setpoint was [\d.]+ s late|no position for [\d.]+ s"


@contextmanager
def rover(folder: Path, *options: str) -> Iterator[int]:
    """A simulated rover that tells its true poses; gives its port."""
    (port,) = free_udp_ports(1)
    where = ("--port", str(port), "--truth", str(folder / "truth.csv"))
    arguments = (*where, "--body", "kinematic", "--boot", "none")
    with process("-m", "rover_sim", *arguments, *options, folder=folder, name="rover") as it:
        it.wait_for("rover_sim: rover 1")
        yield port


@contextmanager
def probe(folder: Path, port: int | str, *options: str) -> Iterator["subprocess.Popen[str]"]:
    """A probe of it."""
    popen = subprocess.Popen(
        [sys.executable, "-m", "mav_tasks.cli", "probe", f"udpout:127.0.0.1:{port}", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
        env=environment_with(XDG_CONFIG_HOME=str(folder)),
    )
    try:
        yield popen
    finally:
        popen.kill()
        popen.communicate()


def truth(folder: Path) -> list[dict[str, float]]:
    text = (folder / "truth.csv").read_text(encoding="ascii")
    rows = csv.DictReader(text[: text.rfind("\n") + 1].splitlines())
    return [{key: float(value) for key, value in row.items()} for row in rows]


def is_moving(folder: Path) -> bool:
    rows = truth(folder)
    return bool(rows) and abs(rows[-1]["forward_speed"]) > 0.15


def driven(folder: Path, port: int, *options: str, interrupt: int = 0) -> tuple[int, str, str]:
    """Probe with driving; once more if the machine stood still, which ends a drive."""
    for _ in range(3):
        with probe(folder, port, "--drive", "--yes", *options) as popen:
            if interrupt:
                while popen.poll() is None and not is_moving(folder):
                    sleep(0.05)  # with a limit: that of the test
                popen.send_signal(interrupt)
            out, error = popen.communicate(timeout=OVER)
        if not re.search(STOOD_STILL, out):
            break
    return popen.returncode, out, error


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_a_rover_that_was_probed_is_driven_as_it_was_found_to_be(tmp_path: Path) -> None:
    """A PX4 that turns at a yaw rate: by course without its profile, with it at that rate."""
    known = tmp_path / "known"
    known.mkdir()
    with rover(tmp_path, "--persona", "px4", "--honours-yaw-rate") as port:
        file = str(tmp_path / "found.toml")
        code, out, error = driven(tmp_path, port, "--output", file)
        assert code == 0, out + error
        assert re.search(
            r"^yaw rate +honoured \(\d\d% of the turn, on the spot\)$", out, re.MULTILINE
        ), out
        assert re.search(r"^left in +ok +Hold, disarmed$", out, re.MULTILINE), out
        assert out.endswith(f"profile written to {file}\n")
        assert "driving within 1 m of its place: keep clear; Ctrl-C stops it" in error
        poses = truth(tmp_path)
        assert all(abs(row["north"]) < 1.0 and abs(row["east"]) < 1.0 for row in poses)
        assert max(abs(row["north"]) for row in poses) > 0.1
        clients, push = free_udp_ports(2)
        serve = ["-m", "mav_tasks.cli", "serve", "--client", f"udpin:127.0.0.1:{clients}"]
        serve += ["--push", f"127.0.0.1:{push}", "--store", ":memory:"]
        serve += ["--vehicle", f"udpout:127.0.0.1:{port}", "--set", f"vehicles.profiles={known}"]
        serve += ["--set", "rules.loss_failsafe=accept"]
        with process(*serve, folder=tmp_path, name="server") as server:
            server.wait_for("rover 1: found")
            stand = Stand(server, server, clients, port, push, tmp_path / "truth.csv")
            client = stand.connect()
            (known / "rover.toml").write_bytes(Path(file).read_bytes())
            server.popen.send_signal(signal.SIGHUP)
            server.wait_for("vehicles.profiles: reloaded, 1 in force")
            server.wait_for("rover 1: uses the profile of ")
            yaw = degrees(truth(tmp_path)[-1]["yaw"])
            submit(client, ROTATE, 90)
            server.wait_for("task 1 completed")
            turned = (degrees(truth(tmp_path)[-1]["yaw"]) - yaw) % 360
            assert turned == pytest.approx(90, abs=3)
            beside = run("probe", f"udpout:127.0.0.1:{clients}")
            assert_one_clear_last_line(beside, "task server 1/191 is on this link: probe")
            stand.close()


def assert_one_clear_last_line(result: tuple[int, str, str], *words: str) -> None:
    """Before it, the probe has said what it is about."""
    code, out, error = result
    assert_one_clear_line((code, out, error.splitlines()[-1]), *words)


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_ended_while_it_drives_it_leaves_the_rover_at_rest(tmp_path: Path) -> None:
    with rover(tmp_path) as port:
        code, out, error = driven(tmp_path, port, "--json", interrupt=signal.SIGINT)
        assert code == 128 + signal.SIGINT, out + error
        found = json.loads(out)
        assert found["drive"]["ended"] == "ended by SIGINT"
        assert found["drive"]["left"] == "HOLD, disarmed"
        assert (found["autopilot"], found["uid"], found["mission_items"]) == ("ardupilot", "1", 0)
        assert found["profile"] is None
        assert not list(tmp_path.glob("**/*.toml"))
        wait_until(lambda: not is_moving(tmp_path), within=2, what="the rover standing")
        seen = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=254)
        seen.mav.heartbeat_send(6, 8, 0, 0, 4)
        beat = seen.recv_match(type="HEARTBEAT", blocking=True, timeout=10)
        assert (beat.custom_mode, beat.base_mode & 128) == (4, 0)
        seen.close()


def test_what_cannot_be_done_is_said_in_one_line() -> None:
    (port,) = free_udp_ports(1)
    url = f"udpout:127.0.0.1:{port}"
    assert_one_clear_line(run("probe", "udpout:192.0.2.1:14550"), "192.0.2.1", "--insecure")
    assert_one_clear_line(run("probe", "pigeon:1"), "udpin:host:port")
    code, _, error = run("probe", url, "--timeout", "1")
    assert (code, error.splitlines()[-1]) == (3, "mav-tasks: no heartbeat from a rover within 1 s")


@pytest.mark.slow
def test_a_px4_that_would_not_stand_is_driven_after_one_command_through_the_server(
    tmp_path: Path,
) -> None:
    with stand(tmp_path, "--set", "rules.loss_failsafe=must_stand", persona="px4") as running:
        client = running.connect()
        submit(client, MOVE, 0.5)
        running.server.wait_for("task 1 waits: loss failsafe")
        url = f"udpout:127.0.0.1:{running.client_port}"
        code, out, error = run("probe", url, "--set-failsafe", "--vehicle", "1")
        assert code == 0, error
        assert "COM_OBL_RC_ACT 0, now 5; stops when setpoints stop: Hold" in out
        running.server.wait_for("task 1 completed")
