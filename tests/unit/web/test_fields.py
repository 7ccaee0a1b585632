"""Bodies of requests: what is read is what was declared, and each fault is named."""

import re
from typing import Any

import pytest

from mav_tasks.web.fields import Field, body_schema, read_body
from mav_tasks.web.problems import Problem

FIELDS = (
    Field("speed", "number", "m/s", True, 0, 5),
    Field("count", "integer", "how many", False, 1),
    Field("name", "string", "a name", False, 1, 4),
    Field("is_on", "boolean", "whether"),
    Field("places", "array", "where", False, 1, 2, items={"type": "object"}),
    Field("how", "string", "in which way", choices=("again", "skip")),
)

BAD: list[tuple[Any, str]] = [
    (None, "the request's body: expected a JSON object"),
    ([], "the request's body: expected a JSON object"),
    ({}, "speed: missing; expected m/s"),
    ({"speed": None}, "speed: missing"),
    ({"speed": "1"}, "speed '1': expected a number"),
    ({"speed": True}, "speed True: expected a number"),
    ({"speed": float("nan")}, "speed nan: expected a number"),
    ({"speed": float("inf")}, "speed inf: expected a number"),
    ({"speed": 10**400}, "speed 1000"),
    ({"speed": -(10**400)}, "speed -1000"),
    ({"speed": -1}, "speed -1: expected at least 0"),
    ({"speed": 6}, "speed 6: expected at most 5"),
    ({"speed": 1, "count": 1.5}, "count 1.5: expected a whole number"),
    ({"speed": 1, "count": 0}, "count 0: expected at least 1"),
    ({"speed": 1, "name": ""}, "name '': expected at least 1 characters"),
    ({"speed": 1, "name": "abcde"}, "name 'abcde': expected at most 4 characters"),
    ({"speed": 1, "name": "\ud800"}, "name '\\ud800': half of a UTF-16 pair"),
    ({"speed": 1, "is_on": 1}, "is_on 1: expected true or false"),
    ({"speed": 1, "places": {}}, "places {}: expected a list"),
    ({"speed": 1, "places": [1, 2, 3]}, "places [1, 2, 3]: expected at most 2 parts"),
    ({"speed": 1, "how": "never"}, "how 'never': expected one of again, skip"),
    ({"speed": 1, "spede": 1}, "'spede': no such part; expected count, how"),
    ({"speed": 1, "x" * 200: 1}, "'xxx"),
]


def test_parts_that_are_not_given_are_none() -> None:
    read = read_body(FIELDS, {"speed": 2, "name": "ab", "count": None})
    assert read == {
        "speed": 2,
        "count": None,
        "name": "ab",
        "is_on": None,
        "places": None,
        "how": None,
    }


@pytest.mark.parametrize(("body", "words"), BAD)
def test_a_wrong_part_is_named(body: Any, words: str) -> None:
    with pytest.raises(Problem, match=re.escape(words)) as problem:
        read_body(FIELDS, body)
    assert problem.value.status == 422
    assert len(problem.value.detail) < 160


def test_the_schema_says_the_same() -> None:
    schema = body_schema(FIELDS)
    assert schema["required"] == ["speed"]
    assert schema["properties"]["speed"] == {
        "type": "number",
        "description": "m/s",
        "minimum": 0,
        "maximum": 5,
    }
    assert schema["properties"]["name"]["maxLength"] == 4
    assert schema["properties"]["places"]["items"] == {"type": "object"}
    assert schema["properties"]["how"]["enum"] == ["again", "skip"]
