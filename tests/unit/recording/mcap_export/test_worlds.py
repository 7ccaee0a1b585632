"""The records of whole worlds as MCAP files: the log in them is the servers' journal."""

from pathlib import Path

from mav_tasks.tasks.events import TaskProgressed
from tests.kit.cases import for_each
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.conftest import make_world as make_world
from tests.scenarios.test_replay import WORLDS
from tests.unit.recording.mcap_export.test_round_trip import json_of, made_of


@for_each("kind", WORLDS)
def test_what_was_decided_is_in_the_file(make_world: MakeWorld, tmp_path: Path, kind: str) -> None:
    world = WORLDS[kind](make_world, tmp_path)
    logs = [json_of(made_of(tmp_path, path)[0])["/tasks/log"] for path in world.end_records()]
    events = world.server.store.events  # type: ignore[attr-defined]
    told = [str(event) for event in events if not isinstance(event, TaskProgressed)]
    assert [each["message"] for each in logs[-1]] == told, "of the last server"
