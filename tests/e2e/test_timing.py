"""The server's own figures of its setpoints, against a capture of what it sends."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.kit.capture import Capture, captured
from tests.kit.processes import environment_with, stand, wait_until

STOPPED = 0.15  # s
AGREE = 0.08  # s, between two clocks' readings of one late setpoint on a busy machine


def command(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "mav_tasks.cli", *arguments],
        capture_output=True,
        text=True,
        timeout=30,
        env=environment_with(),
        check=True,
    )
    return done.stdout


@pytest.mark.slow
def test_a_stopped_server_shows_in_its_own_figures_as_in_a_capture(tmp_path: Path) -> None:
    store = tmp_path / "tasks.sqlite3"
    captures: list[Capture] = []

    @contextmanager
    def way(rover_port: int) -> Iterator[str]:
        with captured(rover_port) as capture:
            captures.append(capture)
            yield capture.url

    with stand(tmp_path, serve_store=str(store), way=way) as running:
        server = f"udpout:127.0.0.1:{running.client_port}"
        link = running.connect()
        running.drive(link, 2.0)
        running.server.popen.send_signal(signal.SIGSTOP)
        time.sleep(STOPPED)  # what is measured
        running.server.popen.send_signal(signal.SIGCONT)
        wait_until(lambda: "task 1 completed" in running.server.text, within=30, what="the end")
        shown = json.loads(command("status", "1", "--json", "--server", server))["setpoints"]
        line = command("status", "1", "--server", server)
    intervals = sorted(b - a for a, b in pairwise(captures[0].moving))
    print(f"server: {shown}")
    print(
        f"capture: {len(intervals)} intervals, p50 {intervals[len(intervals) // 2]:.4f},"
        f" p99 {intervals[int(len(intervals) * 0.99)]:.4f}, max {intervals[-1]:.4f}"
    )
    assert shown["rate"] == 20.0
    assert shown["max"] > STOPPED * 0.9
    assert shown["max"] == pytest.approx(intervals[-1], abs=AGREE)
    assert shown["p50"] == pytest.approx(intervals[len(intervals) // 2], abs=0.01)
    assert shown["late"] >= 1
    # the zeros of the start and the end are not in the captured ones: at most two seconds of them
    assert len(intervals) <= shown["count"] <= len(intervals) + 40
    assert f"setpoints     {shown['count']} at 20 Hz: p50 " in line

    events = [json.loads(row) for row in journal(store)]
    (end,) = [event for event in events if event.get("new") == "completed"]
    assert end["timing"]["count"] == shown["count"]
    assert end["timing"]["longest"] == pytest.approx(shown["max"], abs=1e-4)


def journal(store: Path) -> list[Any]:
    return command("log", "--store", str(store), "--json").splitlines()
