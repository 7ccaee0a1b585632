"""The real MAVSDK 4 takes the simulated PX4 and generic rovers for vehicles; no server between."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.processes import process
from tests.kit.scripts import ROOT

pytestmark = pytest.mark.interop

SCRIPTS = "tests.interop.scripts.simulated"
READY = ("--boot", "none", "--peers", "all")
LIMIT = 20.0  # s for a script


@pytest.mark.parametrize("script", ["telemetry", "parameters", "plans", "modes", "offboard"])
@pytest.mark.parametrize("persona", ["px4", "generic"])
def test_mavsdk_and_a_simulated_rover(persona: str, script: str, tmp_path: Path) -> None:
    rover = ("-m", "rover_sim", "--port", "0", "--body", "kinematic", "--persona", persona, *READY)
    with process(*rover, folder=tmp_path, name="rover") as running:
        started = running.wait_for(rf"rover 1 \({persona}, kinematic\) on udp 127\.0\.0\.1:(\d+)")
        result = subprocess.run(
            [sys.executable, "-m", SCRIPTS, script, started[1]],
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
            cwd=ROOT,
        )
        assert result.returncode == 0, f"{result.stdout}\n{result.stderr}\n{running.text}"
