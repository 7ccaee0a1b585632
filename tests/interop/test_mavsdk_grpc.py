"""MAVSDK's older API (PyPI ``mavsdk-grpc``), unmodified, through the server.

It comes with a server process of its own, which listens on every interface and cannot be told not
to: so all of it runs in a network that has nothing but its loopback.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.own_network import is_possible
from tests.kit.scripts import ROOT, a_net

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(280)]

LIMIT = 250.0  # s; what it starts has shorter ones, so that it ends what it has started


@a_net
def test_the_older_api_drives_a_mission_and_to_a_place(loss: float, tmp_path: Path) -> None:
    if not is_possible():
        pytest.skip("this machine does not allow a network of one's own")
    bench = ["-m", "tests.kit.own_network", "-m", "tests.interop.older_api"]
    done = subprocess.run(
        [sys.executable, *bench, str(tmp_path), str(loss)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LIMIT,
        check=False,
        cwd=ROOT,
    )
    said = done.stdout
    assert done.returncode == 0, said
    assert "heard position velocity_ned attitude_euler battery flight_mode in_air" in said
    assert "downloaded 2" in said
    for goal, state in (("plan", "completed"), ("go to", "executing")):
        ids = re.findall(rf"rover 1: task (\d+) submitted: {goal}", said)
        assert any(f"task {task} {state}" in said for task in ids), said
    if not loss:  # else some of it may be missing
        assert "progress [(0, 2), (1, 2), (2, 2)]" in said
        assert "arrived True" in said
