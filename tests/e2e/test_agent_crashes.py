"""Agents that are killed while they submit, and ask again: each key is one task, driven once."""

import json
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")

from tests.kit import agent_crashes
from tests.kit.agents import url_of
from tests.kit.commands import called
from tests.kit.processes import environment_with, stand, wait_until
from tests.kit.volume import tries

pytestmark = pytest.mark.slow

CRASHES = tries(12, long=1000)  # 0.8 s each
SEED = 20_261_125
INACCURACY = 0.3  # of a step: the rover rolls on for some millimetres
LAST_TASKS = 120.0  # s for those that still wait at the end


def crash(folder: Path, crashes: int, *, limit: float) -> None:
    """Let an agent crash so many times, and judge by what was stored and where the rover was."""
    store = str(folder / "tasks.sqlite3")
    with stand(folder, serve_store=store) as it:
        done = subprocess.run(
            [sys.executable, "-m", agent_crashes.__name__, url_of(it), str(crashes), str(SEED)],
            capture_output=True,
            text=True,
            timeout=limit,
            cwd=Path.cwd(),
            env=environment_with(XDG_CONFIG_HOME=str(folder)),
            check=False,
        )
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)

        def is_idle() -> bool:
            (queue,) = called("queue", "--json", server=url_of(it)).objects
            return queue["running"] is None and not queue["waiting"]

        wait_until(is_idle, within=LAST_TASKS, what="the last task")
        places = [row["north"] for row in it.truth()]
    told = {key: set(ids) for key, ids in found["told"].items()}
    assert all(len(ids) == 1 for ids in told.values()), "a key was told two tasks"
    tasks = {next(iter(ids)) for ids in told.values()}
    assert len(tasks) == len(told), "two keys were told one task"

    events = called("log", "--json", "--store", store).objects
    submitted = Counter(each["task"] for each in events if each["event"] == "TaskSubmitted")
    changes = [each for each in events if each["event"] == "TaskChanged"]
    executed = Counter(each["task"] for each in changes if each["new"] == "executing")
    completed = Counter(each["task"] for each in changes if each["new"] == "completed")
    once = Counter(dict.fromkeys(tasks, 1))
    assert submitted == once, "a task that no key was told, or one too few"
    assert executed == once, "a task was driven twice, or never"
    assert completed == once

    # The journal is exact; the rover's true way shows that it is about the rover at all.
    driven = sum(abs(after - before) for before, after in pairwise(places))
    assert driven == pytest.approx(len(tasks) * agent_crashes.STEP, rel=INACCURACY)
    kills = found["kills"]
    assert sum(kills.values()) == crashes, "each crash is one of these"
    print(f"{crashes} crashes, {len(tasks)} tasks, {driven:.2f} m: {kills}")


@pytest.mark.timeout(2400)
def test_an_agent_that_crashes_and_asks_again_never_drives_twice(tmp_path: Path) -> None:
    crash(tmp_path, CRASHES, limit=2000.0)
