"""The log of a real server, and ``mav-tasks log`` beside it."""

import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple
from pathlib import Path
from typing import Any

import pytest

from tests.kit.commands import mav_tasks
from tests.kit.processes import (
    Process,
    Stand,
    command_long,
    free_udp_ports,
    process,
    stand,
    submit,
    wait_for,
    wait_until,
)

MOVE, STOP, CONTINUE = 54000, 54003, 193
PLAIN = ("event", "level", "message", "task", "vehicle", "old", "new", "reason", "actor", "text")


@contextmanager
def unread(folder: Path) -> Iterator[Stand]:
    """A server and a rover; the server's standard error is a pipe, full from the beginning."""
    client_port, rover_port = free_udp_ports(2)
    truth, output = folder / "truth.csv", folder / "server.log"
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    os.write(write, b"x" * 4096)
    command = [sys.executable, "-m", "mav_tasks.cli", "serve", "--no-push", "--store", ":memory:"]
    command += ["--client", f"udpin:127.0.0.1:{client_port}"]
    command += ["--vehicle", f"udpout:127.0.0.1:{rover_port}"]
    rover = ["-m", "rover_sim", "--port", str(rover_port), "--body", "kinematic"]
    rover += ["--boot", "none"]
    with (
        process(*rover, "--truth", str(truth), folder=folder, name="rover") as rover_process,
        output.open("wb") as sink,
    ):
        server = subprocess.Popen(command, stdout=sink, stderr=write)
        os.close(write)
        it = Stand(Process(server, output), rover_process, client_port, rover_port, 0, truth)
        try:
            it.server.wait_for("store")
            wait_until(truth.exists, within=20, what="the truth file")
            yield it
        finally:
            it.close()
            server.kill()
            server.wait(10)
            os.close(read)


def drained(link: Any) -> bool:
    """Read what came: an answer is lost where there is no room for it."""
    while link.recv_match(blocking=False) is not None:
        pass
    return True


@pytest.mark.slow
def test_a_server_whose_log_nobody_reads_goes_on_driving_and_ends(tmp_path: Path) -> None:
    with unread(tmp_path) as running:
        link = running.connect()
        running.drive(link, 20.0)
        for number in range(300):  # each is refused, with 25 kB of log altogether
            link.mav.command_long_send(1, 191, MOVE, 0, 1e6 + number, 0, 0, 0, 0, 0, 0)
        way = running.truth()[-1]["north"] + 1
        wait_until(
            lambda: drained(link) and running.truth()[-1]["north"] > way,
            within=10,
            what="the way to go on",
        )
        submit(link, STOP)
        wait_until(lambda: drained(link) and running.speed() < 0.01, within=5, what="standstill")
        submit(link, CONTINUE, 1)
        running.drive(link, 20.0)
        asked_at = running.truth()[-1]["time"]
        took = running.server.end()
        assert running.server.popen.returncode == 0
        assert took < 4
        wait_until(lambda: running.speed() < 0.01, within=5, what="the rover to stand")
        assert running.truth()[-1]["time"] - asked_at < 2.5  # not by its own time-out


def export(*options: str) -> tuple[int, str, str]:
    """Run ``mav-tasks log``; gives exit code, standard output and error."""
    return astuple(mav_tasks("log", *options))


def test_the_log_in_json_and_the_journal_beside_the_server_say_the_same(tmp_path: Path) -> None:
    path = tmp_path / "tasks.sqlite3"
    with stand(tmp_path, "--store", str(path), "--log-json") as running:
        follow = ["--follow", "--json", "--task", "1"]
        with begun(path, *follow, stdout=subprocess.PIPE) as follower:
            try:
                link = running.connect()
                submit(link, MOVE, 0.2)
                wait_for(link, "STATUSTEXT", "'Task 1 done' in STATUSTEXT.text", within=30)
                assert command_long(link, MOVE, 1e6).result != 0
                followed = [json.loads(line) for line in lines_until(follower, '"new":"completed"')]
                follower.send_signal(signal.SIGINT)
                assert follower.wait(10) == 0
            finally:
                follower.kill()
        submit(link, MOVE, 0.2)  # nobody holds anything of the store
        running.server.end()
        text = running.server.text
    code, exported, _ = export("--store", str(path), "--json")
    assert code == 0
    told = [json.loads(line) for line in exported.splitlines()]
    kept = [event for event in told if event["level"] != "debug"]
    assert followed == [event for event in told if event.get("task") == 1]
    assert (followed[0]["event"], followed[0]["goal"]["kind"]) == ("TaskSubmitted", "Move")
    assert (followed[-1]["old"], followed[-1]["new"]) == ("executing", "completed")
    assert kept[-1]["event"] == "ServerStopped"

    said = [json.loads(line) for line in text.splitlines()]  # also what it says as it starts
    assert any(each["message"].startswith("clients on ") for each in said)
    times = [each["time"] for each in said]
    assert times == sorted(times)
    texts = [each for each in said if each.get("event") == "VehicleText"]
    assert {each["vehicle"] for each in texts} == {1}  # the simulated autopilot said something
    logged = [each for each in said if "event" in each and each not in texts]
    assert [essence(each) for each in logged] == [essence(each) for each in kept]
    assert "SubmissionRefused" in {each["event"] for each in logged}


def essence(entry: dict[str, Any]) -> dict[str, Any]:
    """What a line says but for times, of which the log has its own."""
    return {key: value for key, value in entry.items() if key in PLAIN}


def lines_until(follower: "subprocess.Popen[bytes]", words: str) -> Iterator[str]:
    assert follower.stdout is not None
    for line in map(bytes.decode, follower.stdout):
        yield line
        if words in line:
            return


def begun(path: Path, *options: str, **streams: Any) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "mav_tasks.cli", "log", "--store", str(path), *options]
    return subprocess.Popen(command, stderr=subprocess.PIPE, **streams)


@pytest.mark.parametrize("closed", [">&-", ">/dev/full 2>&-", ">/dev/full 2>/dev/full"])
def test_a_server_serves_though_nobody_can_be_told(tmp_path: Path, closed: str) -> None:
    client_port, rover_port = free_udp_ports(2)
    command = f"exec {sys.executable} -m mav_tasks.cli serve --store :memory: --no-push"
    command += f" --client udpin:127.0.0.1:{client_port} --vehicle udpout:127.0.0.1:{rover_port}"
    with socket.socket(type=socket.SOCK_DGRAM) as rover:
        rover.bind(("127.0.0.1", rover_port))
        rover.settimeout(20)
        server = subprocess.Popen(["sh", "-c", f"{command} {closed}"], cwd=tmp_path)
        try:
            rover.recv(300)  # its heartbeat
            server.send_signal(signal.SIGTERM)
            assert server.wait(10) == 0
        finally:
            server.kill()
            server.wait(10)
