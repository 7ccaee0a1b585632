"""The command that developers run."""

import subprocess
import sys

IN_README = "python -m rover_sim.check_vehicle"
LIMIT = 50.0  # s


def test_a_rover_that_there_is_not_is_refused() -> None:
    command = [sys.executable, *IN_README.split()[1:], "--rover", "boat"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 2
    assert "px4-differential" in done.stderr
