"""The files are read back by the rules that QGroundControl reads them by."""

import json
import re
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from mav_tasks.basics.errors import UsageError
from mav_tasks.cli.app import app
from mav_tasks.plans.qgc_actions import ACTIONS, FILE_TYPES, parse_action
from tests.kit.cases import for_each

MOVE, STOP = 54000, 54003


def read(text: str, file_type: str) -> list[dict[str, Any]]:
    """As QGroundControl does: wrong types refuse the file, what is unknown is passed over."""

    def refuse(word: str) -> Any:
        raise AssertionError(f"{word} is no JSON")

    file = json.loads(text, parse_constant=refuse)
    assert (file["version"], file["fileType"]) == (1, file_type)
    for action in file["actions"]:
        assert isinstance(action["label"], str)
        assert isinstance(action["description"], str)
        assert isinstance(action["mavCmd"], int)
        assert isinstance(action["compId"], int)
        assert all(isinstance(action[f"param{n}"], float) for n in range(1, 8))
    found: list[dict[str, Any]] = file["actions"]
    assert len({action["label"] for action in found}) == len(found)
    return found


def test_an_action_of_ones_own() -> None:
    action = parse_action("Patrol=54000,2.5,0.4")
    assert (action.label, action.command) == ("Patrol", MOVE)
    assert action.params == (2.5, 0.4, 0.0, 0.0, 0.0, 0.0, 5.0)
    assert parse_action("Urgent=54000,2.5,0,0,0,0,0,9").params[6] == 9.0
    assert parse_action("Horn=183,7,1900").params == (7.0, 1900.0)


def test_a_bad_action_is_named() -> None:
    for text, says in [
        ("54000,1", "expected LABEL=COMMAND"),
        ("=54000,1", "expected LABEL=COMMAND"),
        ("Go=forward", "expected LABEL=COMMAND"),
        ("Go=70000", "expected LABEL=COMMAND"),
        ("Go=54000,far", "'far' is not a number"),
        ("Go=54000,nan", "finite"),
        ("Go=54000,1,2,3,4,5,6,7,8", "at most seven finite parameters"),
    ]:
        with pytest.raises(UsageError, match=re.escape(f"--action {text}") + f".*{says}"):
            parse_action(text)


def run(*arguments: str) -> str:
    result = CliRunner().invoke(app, ["qgc-actions", *arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def test_it_is_printed_in_either_format() -> None:
    assert len(read(run(), "MavlinkActions")) == len(ACTIONS)
    assert len(read(run("--custom", "--action", "Horn=183,7"), "CustomActions")) == len(ACTIONS) + 1
    (only,) = read(run("--only", "--action", "Horn=183,7", "--component", "192"), "MavlinkActions")
    assert (only["label"], only["compId"]) == ("Horn", 192)


@for_each("programs", [["QGroundControl"], ["QGroundControl", "QGroundControl Daily"]])
def test_both_are_installed_where_it_looks(tmp_path: Path, programs: list[str]) -> None:
    """A daily build has a folder of its own."""
    for program in programs[1:]:
        (tmp_path / program).mkdir()
    said = run("--install", "--documents", str(tmp_path))
    for program, file_type in product(programs, FILE_TYPES):
        path = tmp_path / program / file_type / "mav-tasks.json"
        assert f"wrote {path}" in said
        actions = read(path.read_text(encoding="utf-8"), file_type)
        assert [action["compId"] for action in actions] == [191] * len(ACTIONS)
    assert said.count("wrote") == len(programs) * len(FILE_TYPES)
    assert "Enable Custom Actions" in said
