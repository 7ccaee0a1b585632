"""MAVSDK 4, unmodified: missions and places through the server, over good and bad nets.

No answer may take its process down.
"""

import re
from pathlib import Path

import pytest

from tests.kit.processes import stand
from tests.kit.scripts import run_script, some_cases

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(200)]


@some_cases
def test_missions_are_driven_as_tasks(persona: str, loss: float, tmp_path: Path) -> None:
    with stand(tmp_path, persona=persona) as running:
        said = run_script("missions", running, persona=persona, loss=loss)
        assert "raw downloaded [(16, 80), (16, 160), (16, 240)]" in said
        assert "downloaded 2" in said
        log = running.server.text
        plans = [task for task in tasks(log, "plan") if f"task {task} completed" in log]
        assert len(plans) >= 2, log  # more if a start was sent again after the end
        for goal in ("go to", "return"):  # the second interrupts the first
            assert any(f"task {task} executing" in log for task in tasks(log, goal)), log
        assert "(4, 4)" in re.findall(r"raw progress (.*)", said)[0]
        if not loss:  # else some progress may be missing, and a start be sent twice
            assert "progress [(0, 2), (1, 2), (2, 2)]" in said
            assert tasks(log, "") == ["1", "2", "3", "4"]


def tasks(log: str, goal: str) -> list[str]:
    """The ids of the tasks with such a goal."""
    return re.findall(rf"rover 1: task (\d+) submitted: {goal}", log)
