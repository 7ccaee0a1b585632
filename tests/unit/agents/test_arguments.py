from typing import Any

import pytest

from mav_tasks.agents.arguments import read, schema_of
from mav_tasks.agents.driving import HOW, SUBMISSION
from mav_tasks.agents.reading import LIMIT, TASK_ID
from mav_tasks.agents.submission import Wish
from mav_tasks.errors import UsageError
from mav_tasks.tasks.goal import Move

MOVE = {"kind": "move", "distance": 2}


def test_what_is_not_given_is_none_and_a_whole_float_is_whole() -> None:
    assert read((TASK_ID, LIMIT), {"id": 3.0}) == {"id": 3, "limit": None}


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({}, "id: missing; id of the task"),
        ({"id": 0}, "id: expected at least 1"),
        ({"id": 1.5}, "id 1.5: expected a whole number"),
        ({"id": True}, "id True: expected a whole number"),
        ({"id": "1"}, "id '1': expected a whole number"),
        ({"id": 1, "limit": 101}, "limit: expected at most 100"),
        ({"id": 1, "speed": 2}, "speed: unknown; expected id, limit"),
    ],
)
def test_a_wrong_argument_is_named(given: dict[str, Any], why: str) -> None:
    with pytest.raises(UsageError) as refused:
        read((TASK_ID, LIMIT), given)
    assert str(refused.value) == why


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"goals": [MOVE]}, "idempotency_key: missing"),
        ({"goals": [MOVE], "idempotency_key": ""}, "idempotency_key: expected at least 1 char"),
        ({"goals": [], "idempotency_key": "k"}, "goals: expected at least 1 items"),
        ({"goals": MOVE, "idempotency_key": "k"}, "expected a list"),
        ({"goals": [MOVE], "idempotency_key": "k", "start_in": float("nan")}, "start_in nan"),
    ],
)
def test_a_submission_needs_goals_and_a_key(given: dict[str, Any], why: str) -> None:
    with pytest.raises(UsageError, match=why):
        read(SUBMISSION, given)


def test_a_choice_is_one_of_its_words() -> None:
    with pytest.raises(UsageError, match="how 'all': expected one of again, remainder, skip"):
        read((HOW,), {"how": "all"})


def test_a_wish_has_the_goals_and_the_usual_terms() -> None:
    values = read(SUBMISSION, {"goals": [MOVE], "idempotency_key": "k", "start_in": 5})
    wish = Wish.of(1, values)
    assert (wish.goals, wish.key, wish.label) == ([Move(2.0)], "k", "")
    assert wish.terms == {"priority": 5, "after": 0, "delay": 5, "deadline": 0.0}


def test_a_wrong_goal_is_named_by_its_place() -> None:
    values = read(SUBMISSION, {"goals": [MOVE, {"kind": "fly"}], "idempotency_key": "k"})
    with pytest.raises(UsageError, match=r"goals\[1\]\.kind 'fly': expected one of move"):
        Wish.of(1, values)


def test_the_schema_says_what_is_required_and_nothing_else_is_taken() -> None:
    schema = schema_of(SUBMISSION)
    assert schema["required"] == ["goals", "idempotency_key"]
    assert schema["additionalProperties"] is False
    assert "move" in str(schema["properties"]["goals"]["items"])
