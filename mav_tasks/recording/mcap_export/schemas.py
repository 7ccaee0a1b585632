"""JSON schemas of the channels: MAVLink messages, Foxglove's well-known ones, and ours.

Viewers (Foxglove, Lichtblick) read one type for each field, and refuse a list of types. So a
number that may be null, for MAVLink's NaN, has the type "number" in its schema.
"""

import json
from collections.abc import Mapping
from inspect import cleandoc
from typing import Any, NamedTuple

from mav_tasks.mavlink.messages import Message
from mav_tasks.recording.mcap_export.message_json import array_lengths

JsonSchema = dict[str, Any]


class Schema(NamedTuple):
    """A named JSON schema."""

    name: str
    body: JsonSchema

    @property
    def data(self) -> bytes:
        """The schema as JSON."""
        return json.dumps({"title": self.name, **self.body}, separators=(",", ":")).encode()


def _object(description: str, **properties: JsonSchema) -> JsonSchema:
    return {
        "type": "object",
        "description": description,
        "properties": properties,
        "required": list(properties),
    }


def _plain(kind: str, description: str) -> JsonSchema:
    return {"type": kind, "description": description}


def _one_of(description: str, names: Mapping[str, int]) -> JsonSchema:
    alternatives = [{"title": name, "const": value} for name, value in names.items()]
    return {"description": description, "oneOf": alternatives}


def _vector(description: str, *, unit: str = "") -> JsonSchema:
    return _object(description, **{axis: _plain("number", unit or axis) for axis in "xyz"})


_TIME = _object(
    "UTC, from the log time",
    sec={"type": "integer", "minimum": 0},
    nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999},
)

POSE = Schema(
    "foxglove.PoseInFrame",
    _object(
        "Pose of a rover: x forward, y left, z up, in its local frame turned to east, north, up",
        timestamp=_TIME,
        frame_id=_plain("string", "local frame of the rover; its origin is that of the autopilot"),
        pose=_object(
            "position and orientation",
            position=_vector("x east, y north, z up", unit="m"),
            orientation=_object("quaternion", **{part: _plain("number", part) for part in "xyzw"}),
        ),
    ),
)

LOCATION = Schema(
    "foxglove.LocationFix",
    _object(
        "Place of a rover",
        timestamp=_TIME,
        frame_id=_plain("string", "the rover"),
        latitude=_plain("number", "deg"),
        longitude=_plain("number", "deg"),
        altitude=_plain("number", "m above mean sea level"),
        position_covariance={
            "type": "array",
            "items": {"type": "number"},
            "minItems": 9,
            "maxItems": 9,
            "description": "m^2; east, north, up, row by row",
        },
        position_covariance_type=_one_of(
            "what is known of the covariance",
            {"UNKNOWN": 0, "APPROXIMATED": 1, "DIAGONAL_KNOWN": 2, "KNOWN": 3},
        ),
    ),
)

LOG = Schema(
    "foxglove.Log",
    _object(
        "A text",
        timestamp=_TIME,
        level=_one_of(
            "level",
            {"UNKNOWN": 0, "DEBUG": 1, "INFO": 2, "WARNING": 3, "ERROR": 4, "FATAL": 5},
        ),
        message=_plain("string", "the text"),
        name=_plain("string", "who says it"),
        file=_plain("string", "always empty"),
        line=_plain("integer", "always 0"),
    ),
)

SETPOINT = Schema(
    "mav_tasks.Setpoint",
    _object(
        "SET_POSITION_TARGET_LOCAL_NED; a field that its type_mask excludes is null",
        timestamp=_TIME,
        frame=_plain("string", "MAV_FRAME without its prefix"),
        x=_plain("number", "m"),
        y=_plain("number", "m"),
        z=_plain("number", "m"),
        vx=_plain("number", "m/s"),
        vy=_plain("number", "m/s"),
        vz=_plain("number", "m/s"),
        afx=_plain("number", "m/s/s"),
        afy=_plain("number", "m/s/s"),
        afz=_plain("number", "m/s/s"),
        yaw=_plain("number", "rad"),
        yaw_rate=_plain("number", "rad/s"),
    ),
)

TASK_CHANGE = Schema(
    "mav_tasks.TaskChange",
    _object(
        "A task was submitted, restored from the store, moved to another state, modified,"
        " or assigned to a rover by the server",
        timestamp=_TIME,
        event=_plain("string", "submitted, restored, changed, modified, assigned or withdrawn"),
        rover=_plain("integer", "system id"),
        task=_plain("integer", "task id"),
        version=_plain("integer", "counts the changes of the task"),
        state=_plain("string", "TASK_STATE, in lower case"),
        old=_plain("string", "TASK_STATE before; unknown: none"),
        reason=_plain("string", "TASK_REASON, in lower case"),
        label=_plain("string", "the submitter's name for the task"),
        priority=_plain("integer", "0 to 10; 10 runs first"),
        actor=_plain("string", "who caused the change"),
        words=_plain("string", "the change as in the server's log"),
    ),
)

_KINDS = {"float": "number", "double": "number", "char": "string"}  # any other is an integer


def message_schema(kind: type[Message]) -> Schema:
    """Return the schema of a MAVLink message, from its definition."""
    lengths = array_lengths(kind)
    properties = {
        name: _field(kind, index, name, lengths[name]) for index, name in enumerate(kind.fieldnames)
    }
    description = " ".join(cleandoc(kind.__doc__ or "").split())
    body = {"type": "object", "description": description, "properties": properties}
    return Schema(f"mavlink.{kind.msgname}", body)


def _field(kind: type[Message], index: int, name: str, length: int) -> JsonSchema:
    on_wire = kind.fieldtypes[index]
    notes = [on_wire, kind.fieldunits_by_name.get(name, ""), kind.fieldenums_by_name.get(name, "")]
    description = ", ".join(filter(None, notes))
    json_kind = _KINDS.get(on_wire, "integer")
    if not length or json_kind == "string":
        return _plain(json_kind, description)
    return {"type": "array", "items": {"type": json_kind}, "description": description}
