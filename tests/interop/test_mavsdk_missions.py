"""MAVSDK's plugins, unmodified, through the server: each script a process of its own, which
must not crash.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.processes import Stand, stand

pytestmark = [pytest.mark.interop, pytest.mark.timeout(170)]

SCRIPTS = Path(__file__).parent / "scripts"


def run(script: str, running: Stand) -> str:
    """Run a script to its end; gives what it printed."""
    url = f"udpout://127.0.0.1:{running.client_port}"
    done = subprocess.run(
        [sys.executable, str(SCRIPTS / script), url],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{running.server.text}"
    return done.stdout


def test_missions_are_driven_as_tasks(tmp_path: Path) -> None:
    with stand(tmp_path) as running:
        said = run("missions.py", running)
        assert "raw downloaded [(16, 90), (16, 180), (16, 270)]" in said
        assert "raw progress (4, 4)" in said
        assert "downloaded 3" in said
        assert "progress [(0, 3), (1, 3), (2, 3), (3, 3)]" in said
        assert said.rstrip().endswith("done")
        log = running.server.text
        for task in (1, 2):
            assert f"task {task} completed" in log
        for task in (3, 4):  # the go-to, and the return that interrupts it
            assert f"task {task} executing" in log


def test_fence_parameters_and_own_setpoints_work_as_without_a_server(tmp_path: Path) -> None:
    with stand(tmp_path) as running:
        said = run("plugins.py", running)
        lines = ["fence uploaded", "fence cleared", "set 3.0 1", "all True True", "moves", "stands"]
        assert [line for line in said.splitlines() if line in lines] == lines
        assert said.rstrip().endswith("done")
        assert "task 1" not in running.server.text, "none of it is a task"
