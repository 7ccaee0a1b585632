"""MAVSDK 4, unmodified: all besides missions through the server, over good and bad
nets. No answer may take its process down.
"""

import re
from pathlib import Path

import pytest

from mav_tasks.config.parameter_table import PARAMETERS
from tests.interop.scripts.heard import STREAMS
from tests.kit.processes import stand
from tests.kit.scripts import run_script, some_makes

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(200)]


@some_makes
def test_fence_parameters_and_own_setpoints_work_as_without_a_server(
    persona: str, loss: float, tmp_path: Path
) -> None:
    with stand(tmp_path, persona=persona) as running:
        said = run_script("plugins", running, persona=persona, loss=loss)
        for line in ("fence [4]", "fences 0", "parameters True True", "moves", "stands"):
            assert line in said, said
        assert f"of the server {len(PARAMETERS)}" in said
        assert "TSK_SPEED 0.75" in said
        if not loss:
            assert "TSK_SPEED VALUE_OUT_OF_RANGE" in said
            assert "TSK_NONE DOES_NOT_EXIST" in said
        assert "task 1" not in running.server.text, "none of it is a task"


@some_makes
def test_every_stream_of_telemetry_comes_and_tells_of_the_drive(
    persona: str, loss: float, tmp_path: Path
) -> None:
    with stand(tmp_path, persona=persona) as running:
        said = run_script("streams", running, persona=persona, loss=loss)
        assert f"heard {' '.join(STREAMS)}" in said, said


@some_makes
def test_with_our_dialect_each_request_tells_its_task(
    persona: str, loss: float, tmp_path: Path
) -> None:
    with stand(tmp_path, persona=persona) as running:
        said = run_script("direct", running, persona=persona, loss=loss)
        log = running.server.text
        assert "task 1 completed" in said
        assert "goto [(0, 2)]" in said
        mission = re.search(r"mission (\d+)$", said, re.MULTILINE)
        assert mission is not None, said
        assert f"rover 1: mission {mission[1]} stored by" in log
        assert "task 1 completed" in log
        for goal in ("move", "go to"):
            assert len(re.findall(rf"submitted: {goal}", log)) == 1, (
                "sent again, it is the same task"
            )
