"""Kinds of tasks from other packages: the dock of the examples, and broken ones."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Number
from mav_tasks.kinds import Act, Face, Move
from mav_tasks.kinds.form import Form
from mav_tasks.kinds.in_json import OWN
from mav_tasks.kinds.plugged import plugged

EXAMPLES = Path(__file__).parents[3] / "tools" / "examples"
#: what each surface knows of the kinds, one name on each line
SEEN = """
from mav_tasks.agents.driving import driving
from mav_tasks.kinds.in_json import FORMS, goal_schema, goals_of
print([form.title for form in FORMS][-1])
print([kind["properties"]["kind"]["const"] for kind in goal_schema()["oneOf"]][-1])
print("'const': 'dock'" in repr(driving("")))
print([goal.words for goal in goals_of([{"kind": "dock", "heading": 90, "depth": 0.5}])])
"""


def install(folder: Path, **homes: str) -> None:
    """Install a package of entry points, which are names and homes of kinds."""
    place = folder / "others-1.0.dist-info"
    place.mkdir()
    (place / "METADATA").write_text("Metadata-Version: 2.1\nName: others\nVersion: 1.0\n")
    lines = [f"{name} = {home}" for name, home in homes.items()]
    (place / "entry_points.txt").write_text("\n".join(["[mav_tasks.kinds]", *lines]))


def told(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": f"{folder}:{EXAMPLES}", "COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False
    )


def test_the_dock_of_the_examples_is_on_every_surface(tmp_path: Path) -> None:
    install(tmp_path, dock="dock:FORM")
    done = told(tmp_path, "-c", SEEN)
    assert done.stdout.splitlines() == [
        "Dock",
        "dock",
        "True",
        "['face 90 deg', 'move -0.5 m', 'act relay-on']",
    ], done.stderr
    done = told(tmp_path, "-m", "mav_tasks.cli", "submit", "dock", "--help")
    assert "Face away from the dock, back in, and switch the charger on." in done.stdout
    for words in ("DEGREES", "METRES", "--relay", "Relay of the charger; 0 if not given."):
        assert words in done.stdout


def test_a_broken_one_is_named_and_left_out(tmp_path: Path) -> None:
    install(tmp_path, dock="dock:FORM", gone="nowhere:FORM", other="dock:DEGREE")
    script = "from mav_tasks.kinds.in_json import FORMS, PLUGGED; print(FORMS[-1].name, PLUGGED[1])"
    done = told(tmp_path, "-c", script)
    assert done.stdout.startswith("dock kind of task gone (nowhere:FORM) is left out: ")
    assert "No module named 'nowhere'" in done.stdout
    assert "other (dock:DEGREE) is left out: expected a Form, not float" in done.stdout


def form(name: str = "mine", *parts: str) -> Form:
    numbers = tuple(Part(part, Number(0, 1), "what") for part in parts)
    return Form(name, "Mine", "Mine.", numbers, lambda: Move(1.0))


def with_module(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Any:
    """Install an entry point, and return the module that it names, still without its FORM."""
    install(folder, mine="test_plugged_kind:FORM")
    monkeypatch.syspath_prepend(str(folder))
    module = type(sys)("test_plugged_kind")
    monkeypatch.setitem(sys.modules, "test_plugged_kind", module)
    return module


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (form("move"), "there is a kind move already"),
        (form("My kind"), "name 'My kind': expected lower case letters, digits and underscores"),
        (form("mine", "terms"), "terms: an option of each task has this name"),
        (
            form("mine", "class"),
            "name 'class': expected lower case letters, digits and underscores",
        ),
        (form("mine", "a", "a"), "its numbers are not Parts with names of their own"),
    ],
)
def test_what_is_wrong_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, broken: Form, words: str
) -> None:
    with_module(monkeypatch, tmp_path).FORM = broken
    found = plugged([each.name for each in OWN])
    assert found.forms == ()
    assert found.broken.endswith(words)


def test_what_makes_no_goals_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    module = with_module(monkeypatch, tmp_path)
    for made, words in (((), "made no goals"), (None, "made no goals, but None")):
        module.FORM = Form("mine", "Mine", "Mine.", (), lambda made=made: made)
        (kind,) = plugged([]).forms
        with pytest.raises(SettingError, match=words):
            kind.make()
    goals = (Face(0.0), Act(181))
    module.FORM = Form("mine", "Mine", "Mine.", (), lambda: goals)
    assert plugged([]).forms[0].make() == goals
