import json
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.layout import Layout
from mav_tasks.mavlink.messages import Message
from mav_tasks.mcap_export import schemas
from mav_tasks.mcap_export.message_json import MessageJson
from mav_tasks.mcap_export.schemas import Schema, message_schema
from tests.unit.mcap_export.json_schema import check, check_schema

OURS = [schemas.POSE, schemas.LOCATION, schemas.LOG, schemas.SETPOINT, schemas.TASK_CHANGE]

#: as Foxglove's documentation has them: each field that a message must have
FOXGLOVE = {
    "foxglove.PoseInFrame": {
        "timestamp": {"sec", "nsec"},
        "frame_id": "string",
        "pose": {"position": {"x", "y", "z"}, "orientation": {"x", "y", "z", "w"}},
    },
    "foxglove.LocationFix": {
        "timestamp": {"sec", "nsec"},
        "frame_id": "string",
        "latitude": "number",
        "longitude": "number",
        "altitude": "number",
        "position_covariance": "array",
        "position_covariance_type": [0, 1, 2, 3],
    },
    "foxglove.Log": {
        "timestamp": {"sec", "nsec"},
        "level": [0, 1, 2, 3, 4, 5],
        "message": "string",
        "name": "string",
        "file": "string",
        "line": "integer",
    },
}


def shape(schema: dict[str, Any]) -> Any:
    """Return the names and types of a schema: a set for an object of numbers."""
    if "oneOf" in schema:
        return [each["const"] for each in schema["oneOf"]]
    if schema["type"] != "object":
        return schema["type"]
    parts = {name: shape(part) for name, part in schema["properties"].items()}
    is_flat = all(part in ("number", "integer") for part in parts.values())
    return set(parts) if is_flat else parts


@pytest.mark.parametrize("name", FOXGLOVE)
def test_viewers_find_the_fields_that_they_look_for(name: str) -> None:
    (schema,) = [each for each in OURS if each.name == name]
    assert shape(schema.body) == FOXGLOVE[name]
    assert json.loads(schema.data)["title"] == name


def types(schema: dict[str, Any]) -> list[Any]:
    """Return the types of all fields."""
    if "oneOf" in schema:
        return []
    parts = [*schema.get("properties", {}).values(), *filter(None, [schema.get("items")])]
    return [schema["type"], *(kind for part in parts for kind in types(part))]


@pytest.mark.parametrize(
    "schema", [*OURS, *map(message_schema, m.ALL.values())], ids=lambda schema: schema.name
)
def test_viewers_can_read_it(schema: Schema) -> None:
    """They know neither lists of types nor any other kind."""
    check_schema(schema.body)
    assert schema.body["type"] == "object"
    known = {"object", "array", "string", "number", "integer"}
    assert all(isinstance(kind, str) and kind in known for kind in types(schema.body))


@pytest.mark.parametrize("kind", m.ALL.values(), ids=lambda kind: kind.msgname)
def test_each_message_fits_its_schema(kind: type[Message]) -> None:
    layout = Layout(kind)
    for payload in (b"", b"\xff" * layout.struct.size):
        message = json.loads(MessageJson(kind).encode(layout.message(payload)))
        check(message, message_schema(kind).body, kind.msgname)


def test_a_field_says_its_type_unit_and_enum() -> None:
    fields = message_schema(m.GlobalPositionInt).body["properties"]
    assert fields["lat"] == {"type": "integer", "description": "int32_t, degE7"}
    assert message_schema(m.Heartbeat).body["properties"]["type"]["description"] == (
        "uint8_t, MAV_TYPE"
    )
