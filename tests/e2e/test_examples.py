"""Each script of tools/examples does what its first line says, beside a real server and rover."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from mav_tasks import SyncClient
from tests.kit.processes import stand, wait_until

EXAMPLES = Path(__file__).resolve().parents[2] / "tools" / "examples"


def run(name: str, *arguments: str, folder: Path) -> Sequence[str]:
    """Return the lines that a script prints."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=50,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    return done.stdout.splitlines()


@pytest.mark.slow
@pytest.mark.timeout(150)
def test_each_example_does_what_it_says(tmp_path: Path) -> None:
    with stand(tmp_path) as it:
        url = f"udpout:127.0.0.1:{it.client_port}"
        with SyncClient(url) as tasks:  # only on a rover that is ready a task starts at once
            wait_until(
                lambda: any(v.is_ready and v.position_age is not None for v in tasks.vehicles()),
                within=30,
                what="a rover that is ready",
            )

        added, status, queue, took, cleared = run("tutorial_services.py", url, folder=tmp_path)
        assert added == "added tasks 1 2 3"
        assert status.startswith("task 1: ")
        assert queue == "runs: 1 waits: [2, 3]"
        assert took.startswith("task 2 took ")
        assert cleared == "after clear: 0 tasks wait"

        sides = run("patrol.py", url, "1", "0.3", folder=tmp_path)
        assert [side.split(":")[0] for side in sides] == [f"round 1 side {n}" for n in (1, 2, 3, 4)]

        (first,) = run("exactly_once.py", url, folder=tmp_path)
        (again,) = run("exactly_once.py", url, folder=tmp_path)
        assert first.split(":")[0] == again.split(":")[0]

    assert {path.name for path in EXAMPLES.glob("*.py")} == {
        "tutorial_services.py",
        "patrol.py",
        "exactly_once.py",
        "dock.py",  # a kind of task: tests/unit/kinds
    }
