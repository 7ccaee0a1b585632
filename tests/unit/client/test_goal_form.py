"""Goals as JSON: each kind becomes the goal that it names; a wrong part is named."""

import re
from math import inf, nan, pi, radians
from typing import Any

import pytest

from mav_tasks.client.goal_form import KINDS, goal_of, goal_schema
from mav_tasks.client.wire import Goal, items_of_goals
from mav_tasks.tasks.goal import Drive, Face, GlobalPlace, GoTo, LocalPlace, Move, Rotate, Wait

GOOD: list[tuple[dict[str, Any], Goal]] = [
    ({"kind": "move", "distance": -2, "speed": 0.5}, Move(-2.0, 0.5)),
    ({"kind": "rotate", "angle": 90}, Rotate(pi / 2)),
    (
        {"kind": "drive", "forward": 0.5, "yaw_rate": 180, "duration": 2},
        Drive(0.5, pi, 2.0),
    ),
    (
        {"kind": "goto", "north": 4, "east": -2.5, "heading": 90, "wait": 3, "radius": 0.5},
        GoTo(LocalPlace(4.0, -2.5), radius=0.5, yaw=pi / 2, wait=3.0),
    ),
    (
        {"kind": "goto_global", "latitude": 47.3977, "longitude": -8.5456},
        GoTo(GlobalPlace(473977000, -85456000)),
    ),
    ({"kind": "face", "heading": 180, "direction": -1, "rate": 10}, Face(pi, -1, radians(10))),
    ({"kind": "wait", "duration": 0.5}, Wait(0.5)),
    ({"kind": "home", "speed": None}, GoTo(None)),
]

BAD: list[tuple[Any, str]] = [
    (None, "goal: expected an object"),
    ([1], "goal: expected an object"),
    ({}, "goal.kind None: expected one of move"),
    ({"kind": ["move"]}, "goal.kind ['move']"),
    ({"kind": "fly"}, "goal.kind 'fly': expected one of move, rotate"),
    ({"kind": "move"}, "goal.distance: missing; expected distance"),
    ({"kind": "move", "distance": "2"}, "goal.distance '2': expected a number (m)"),
    ({"kind": "move", "distance": True}, "goal.distance True: expected a number (m)"),
    ({"kind": "move", "distance": nan}, "goal.distance nan"),
    ({"kind": "move", "distance": inf}, "goal.distance inf"),
    ({"kind": "move", "distance": 2, "speed": -1}, "goal.speed -1: expected at least 0 m/s"),
    ({"kind": "move", "distance": 2, "spede": 1}, "goal.spede: a goal 'move' has no such part"),
    ({"kind": "goto_global", "latitude": 91, "longitude": 0}, "expected at most 90 deg"),
]


@pytest.mark.parametrize(("form", "goal"), GOOD)
def test_each_kind_becomes_its_goal(form: dict[str, Any], goal: Goal) -> None:
    assert goal_of(form) == goal
    assert items_of_goals([goal_of(form)])


def test_every_kind_is_tried() -> None:
    assert {form["kind"] for form, _ in GOOD} == {kind.name for kind in KINDS}


@pytest.mark.parametrize(("form", "words"), BAD)
def test_a_wrong_part_is_named(form: Any, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        goal_of(form)


def test_the_schema_names_what_is_required() -> None:
    schemas = {each["properties"]["kind"]["const"]: each for each in goal_schema()["oneOf"]}
    assert schemas["goto"]["required"] == ["kind", "north", "east"]
    assert schemas["goto_global"]["properties"]["latitude"]["maximum"] == 90.0
