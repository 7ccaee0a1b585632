"""The comparison of two revisions finds what differs, and says which entry explains it."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.world import World

ROOT = Path(__file__).resolve().parents[3]
EXPAND = ROOT / "tools" / "compare_cores" / "inside" / "expand.py"


def compare(code: str, folder: Path) -> Any:
    """Run code that knows ``found``, a record's Compared, and ``table``; gives what it prints."""
    script = f"""
import json, sys
from pathlib import Path
from tools.compare_cores import compared, entries, workers
from tools.compare_cores.differences import Difference, Kind
from tools.compare_cores.recorded import records_in
from tools.compare_cores.compared import Comparison
from mav_tasks.engine.outlet import Outlet
from mav_tasks.services.heartbeat import gcs_heartbeat

def found(table=()):
    Comparison.__init__.__kwdefaults__["table"] = tuple(table)
    (one,) = workers.compare_some(Path({str(ROOT)!r}), list(records_in(Path({str(folder)!r}))))
    return one

{code}
"""
    ended = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=50,
    )
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of a world in which a task is driven."""
    folder = tmp_path_factory.mktemp("records")
    world = World(records=folder, conditions=Conditions(delay=0.02, jitter=0.02), seed=3).ready()
    world.client.move(0.5, nonce=1)
    world.until(lambda: world.state(1)[0] is S.COMPLETED, within=30)
    world.end_records()
    return folder


def test_a_core_decides_the_same_as_itself(folder: Path) -> None:
    said = compare("print(json.dumps(vars(found())))", folder)
    assert said["unexplained"] == []
    assert said["unusable"] == ""
    assert (said["skipped"], said["added"]) == (0, 0)
    assert said["packets"] > 300
    assert said["seconds"] > 5.0


#: packs every TASK_STATUS with another priority
OTHERWISE = """
from mav_tasks.engine.clients import displays
from mav_tasks.mavlink import messages as m
made = m.TaskStatus.__init__
def other(self, *given, **named):
    made(self, *given, **named)
    self.priority = 9
m.TaskStatus.__init__ = other
"""


def test_a_packet_that_differs_is_shown_field_by_field(folder: Path) -> None:
    said = compare(OTHERWISE + "print(json.dumps(found().unexplained))", folder)
    assert said[0].startswith("changed TASK_STATUS at ")
    assert said[1] == "    priority: 5 → 9"
    assert said[2].startswith("  old: TASK_STATUS(")


def test_an_entry_of_the_table_explains_it_and_the_rest_is_compared(folder: Path) -> None:
    said = compare(
        OTHERWISE
        + """
entry = entries.Intended("all are 9", "why", lambda d: set(d.fields) == {"priority"})
print(json.dumps(vars(found([entry]))))
""",
        folder,
    )
    assert said["unexplained"] == []
    assert said["intended"]["all are 9"] > 2
    assert said["left_out"] == 0


def test_after_an_entry_that_diverges_nothing_is_compared(folder: Path) -> None:
    said = compare(
        OTHERWISE
        + """
entry = entries.Intended("all are 9", "why", lambda d: True, entries.After.DIVERGES)
print(json.dumps(vars(found([entry]))))
""",
        folder,
    )
    assert said["intended"] == {"all are 9": 1}
    assert said["diverged"].startswith("all are 9, from ")
    assert said["left_out"] > 100


def test_a_core_that_raises_is_reported(folder: Path) -> None:
    said = compare(
        """
from mav_tasks.engine.engine import Engine
def fails(self, *, now):
    raise KeyError("broken")
Engine.handle_deadline = fails
print(json.dumps(found().unexplained))
""",
        folder,
    )
    assert said[0].startswith("crashed  at ")
    assert "KeyError: 'broken'" in said[0]


def test_a_record_that_its_own_revision_does_not_repeat_is_of_no_use(
    folder: Path, tmp_path: Path
) -> None:
    import gzip

    (record,) = folder.glob("*.decisions.gz")
    lines = gzip.decompress(record.read_bytes()).decode().splitlines()
    at = next(n for n, line in enumerate(lines) if line.startswith('["deadline"'))
    changed = [line for n, line in enumerate(lines[:-1]) if n != at]  # and without its end mark
    (tmp_path / record.name).write_bytes(gzip.compress("".join(f"{x}\n" for x in changed).encode()))
    said = compare("print(json.dumps(vars(found())))", tmp_path)
    assert said["unusable"].startswith("not replayed by its own revision: line ")
    assert said["unexplained"] == []
