"""Adding a kind of task touches five source files, and nothing else: TASK_DOCK, in a copy.

Beside them there are the definition in ``dialects/`` and the printed table; the tests of those say
so when they are forgotten. What is added here is a skeleton: straight on, slowly, then stand.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

#: file -> what is added, and before which line
ADDED = {
    "mavlink/enums.py": {
        "    TASK_STOP = 54003\n": "    TASK_DOCK = 54004\n",
    },
    "engine/policy/commands.py": {
        "    54003: handled(": '    54004: replace(SUBMITS, name="TASK_DOCK"),\n',
    },
    "engine/commands/goals.py": {
        "    Drive,\n": "    Dock,\n",
        "GOALS: dict[": (
            "def _dock(command: Command, driving: Driving) -> SingleGoal:\n"
            "    longest = driving.max_distance\n"
            "    return Dock(number(command, 1, 'distance', low=0.1, high=longest))\n\n"
        ),
        "    MavCmd.NAV_WAYPOINT: _waypoint,\n": "    MavCmd.TASK_DOCK: _dock,\n",
    },
    "tasks/goal.py": {
        "#: a goal that drives on its own": (
            "@dataclass(frozen=True, slots=True)\nclass Dock:\n"
            '    """Drive ``distance`` metres straight on, slowly, and stand there."""\n\n'
            "    distance: float\n\n\n"
        ),
        "        case Wait(duration=duration):\n            return f": (
            '        case Dock(distance=far):\n            return f"dock in {far:g} m"\n'
        ),
        "        case GoTo():\n            return": (
            '        case Dock():\n            return "goto"\n'
        ),
    },
    "tasks/driving/legs.py": {
        "    Drive,\n": "    Dock,\n",
        "    return 3 if isinstance(goal, MoveTurned)": (
            "    if isinstance(goal, Dock):\n        return 2\n"
        ),
        "        case Head():\n            return (": (
            "        case Dock(distance=distance):\n"
            "            return Wait(1.0) if progress.leg else Move(distance, 0.2)\n"
        ),
    },
}

SCRIPT = """
from mav_tasks import __file__ as where
from mav_tasks.tasks.goal import Dock, describe
from mav_tasks.tasks.lifecycle import TaskState
from tests.kit.world import World, near_pose
assert where.startswith({copy!r}), where
world = World().ready()
refused = world.client.command(54004, 0.0)
sent = world.client.command(54004, 1.5)
world.until_state(1, TaskState.EXECUTING)
world.run(4)
assert 0.15 < world.truth.forward_speed < 0.25
world.until_state(1, TaskState.COMPLETED)
assert refused.result == 2 and sent.task_id == 1
assert near_pose(world.pose(), (1.5, 0.0, 0.0)), world.pose()
assert describe(world.task(1).goal) == "dock in 1.5 m"
assert any(text.startswith("Task 1 queued") for text in world.client.texts()), world.client.texts()
world.check()
"""


@pytest.mark.patches_core
def test_a_new_kind_of_task_is_five_files(tmp_path: Path) -> None:
    copy = tmp_path / "mav_tasks"
    shutil.copytree(ROOT / "mav_tasks", copy, ignore=shutil.ignore_patterns("__pycache__"))
    for name, additions in ADDED.items():
        path = copy / name
        text = path.read_text(encoding="utf-8")
        for before, added in additions.items():
            assert text.count(before) == 1, f"{name}: {before}"
            text = text.replace(before, added + before)
        path.write_text(text.replace("SingleGoal = Move", "SingleGoal = Dock | Move"), "utf-8")
    assert len(ADDED) <= 5
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(copy=str(copy))],
        cwd=tmp_path,
        env={"PYTHONPATH": f"{tmp_path}:{ROOT}:{ROOT / 'sim'}"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
