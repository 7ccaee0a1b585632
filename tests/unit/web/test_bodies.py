"""Bodies: a large one is read in a process of its own, to the same parts."""

import json
from typing import Any

import pytest

from mav_tasks.errors import MavTasksError
from mav_tasks.plan_files import parse_plan
from mav_tasks.web.bodies import read
from mav_tasks.web.fields import Field
from mav_tasks.web.guard import SMALL_BODY
from mav_tasks.web.plan_text import NAME, text_field
from tests.kit.awaited import awaited

FILE = (NAME, text_field("a file"), Field("label", "string", "a text"))
PLAN: dict[str, Any] = {
    "fileType": "Plan",
    "version": 1,
    "groundStation": "QGroundControl",
    "mission": {
        "version": 2,
        "items": [
            {
                "type": "SimpleItem",
                "command": 16,
                "frame": 3,
                "params": [0, None, 0, None, 47.1, 8.5, 0],
                "autoContinue": True,
                "doJumpId": 1,
            }
        ],
        "plannedHomePosition": [47.0, 8.5, 400],
        "firmwareType": 3,
        "vehicleType": 10,
    },
    "geoFence": {
        "version": 2,
        "circles": [
            {"circle": {"center": [47, 8.5], "radius": 60.5}, "inclusion": True, "version": 1}
        ],
        "polygons": [
            {"polygon": [[47, 8], [47, 9], [48, 9]], "inclusion": False, "version": 1},
        ],
    },
    "rallyPoints": {"version": 2, "points": [[47.2, 8.5, 3]]},
}


def body_of(text: str, **more: object) -> bytes:
    """Return a body, also one that is large: blanks do not count."""
    return json.dumps({"text": text, "name": "a.plan"} | more).encode()


@awaited
async def test_a_large_file_is_the_same_plan() -> None:
    """Compared as text: NaN is not equal to itself."""
    text = json.dumps(PLAN)
    large = body_of(text, label="ä") + b" " * SMALL_BODY
    parts = await read(large, FILE, "plan")
    assert repr(parts) == repr(await read(body_of(text, label="ä"), FILE, "plan"))
    assert repr(parts["plan"]) == repr(parse_plan(text))
    assert parts["label"] == "ä"
    assert await read(large, FILE, "preview") == await read(body_of(text), FILE, "preview")


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        (body_of("QGC WPL 110\n1"), 422, "a.plan: line 2"),
        (b'{"text": 1}', 422, "text 1: expected a text"),
        (b'{"text": "x", "text": "y"}', 422, "text: it comes twice"),
        (b'{"text', 400, "the request's body is not JSON"),
        (b"[" * 300_001, 413, "the body has more than 300000 parts"),
        (b"[" * 200_000, 400, "the request's body is not JSON"),
    ],
)
@awaited
async def test_a_large_body_is_refused_in_the_same_words(
    body: bytes, status: int, words: str
) -> None:
    for each in (body, body + b" " * SMALL_BODY):
        with pytest.raises(MavTasksError) as refused:
            await read(each, FILE, "plan")
        assert str(refused.value).startswith(words)
        assert getattr(refused.value, "status", 422) == status
