"""The JSON schemas of the API's answers, as ``forms`` and the handlers make them."""

from collections.abc import Mapping
from typing import Any

from mav_tasks.tasks.lifecycle import TaskReason, TaskState

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
INTEGER: Schema = {"type": "integer"}
TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}
REASON: Schema = {"type": "string", "enum": [reason.name.lower() for reason in TaskReason]}


def ref(name: str) -> Schema:
    """Return a reference to a schema of this document."""
    return {"$ref": f"#/components/schemas/{name}"}


def or_null(schema: Schema, meaning: str = "") -> Schema:
    """Return the schema of a value that may be unknown."""
    if "$ref" in schema:
        return {"anyOf": [schema, {"type": "null"}]} | ({"description": meaning} if meaning else {})
    found = dict(schema) | {"type": [schema["type"], "null"]}
    if "enum" in schema:
        found["enum"] = [*schema["enum"], None]
    return said(found, meaning)


def said(schema: Schema, meaning: str) -> Schema:
    """Return a schema with its meaning."""
    return schema | ({"description": meaning} if meaning else {})


def listed(schema: Schema) -> Schema:
    """Return the schema of a list."""
    return {"type": "array", "items": schema}


def whole(parts: Mapping[str, Schema], *, optional: tuple[str, ...] = ()) -> Schema:
    """Return the schema of an object with exactly these parts."""
    required = [name for name in parts if name not in optional]
    return {
        "type": "object",
        "properties": dict(parts),
        "required": required,
        "additionalProperties": False,
    }


MAYBE = or_null(NUMBER)
PLACE = whole(
    {
        "north": said(NUMBER, "m north of the rover's local origin"),
        "east": said(NUMBER, "m east of it"),
        "latitude": said(NUMBER, "deg"),
        "longitude": said(NUMBER, "deg"),
    },
    optional=("north", "east", "latitude", "longitude"),
)

VEHICLE = whole(
    {
        "vehicle": said(INTEGER, "system id of the rover"),
        "kind": said(TEXT, "ardupilot, px4, other or unknown"),
        "mode": TEXT,
        "armed": or_null(FLAG),
        "heard": said(FLAG, "its heartbeats arrive"),
        "heartbeat_age": or_null(NUMBER, "s"),
        "data_age": or_null(NUMBER, "s since its position arrived"),
        "north": or_null(NUMBER, "m north of its local origin"),
        "east": or_null(NUMBER, "m east of it"),
        "heading": or_null(NUMBER, "deg clockwise from north"),
        "speed": or_null(NUMBER, "m/s"),
        "latitude": or_null(NUMBER, "deg"),
        "longitude": or_null(NUMBER, "deg"),
        "battery": or_null(ref("Battery")),
        "ready": or_null(FLAG, "its checks before arming pass"),
        "prearm": said(listed(TEXT), "what those checks reported lately"),
        "control": said(
            {"type": "string", "enum": ["tasks", "paused", "taken over", "stopped", "silent"]},
            "what controls it",
        ),
        "control_words": TEXT,
        "goal": or_null(ref("Place")),
        "origin": or_null(ref("Place"), "origin of its local frame"),
        "server_component": INTEGER,
    }
)
TASK = whole(
    {
        "id": INTEGER,
        "vehicle": INTEGER,
        "what": TEXT,
        "label": or_null(TEXT),
        "every": or_null(INTEGER, "it repeats: s from one start to the next"),
        "cron": or_null(TEXT, "it repeats: a cron expression, perhaps with a time zone, else UTC"),
        "series": or_null(INTEGER, "id of the first run of its series"),
        "command": INTEGER,
        "state": {"type": "string", "enum": [state.name.lower() for state in TaskState]},
        "reason": or_null(REASON),
        "why": or_null(TEXT, "why it is in its state, in words"),
        "remedy": or_null(ref("Remedy"), "what the user can do about it"),
        "priority": INTEGER,
        "after": or_null(INTEGER),
        "position": or_null(INTEGER, "number of tasks that run before it"),
        "progress": or_null(NUMBER, "0 to 1"),
        "left": or_null(NUMBER, "what is left of it"),
        "left_unit": or_null(TEXT, "unit of that: m, deg, s or items"),
        "item": INTEGER,
        "items": INTEGER,
        "time_to_start": or_null(NUMBER, "s"),
        "time_to_finish": or_null(NUMBER, "s"),
        "execution_time": or_null(NUMBER, "s"),
        "nonce": or_null(INTEGER),
        "submitted_by": said(TEXT, "who submitted it, in words"),
        "submitter": said(TEXT, "system and component id of who submitted it"),
        "version": INTEGER,
        "halt_epoch": said(
            INTEGER, "the present one of its rover, to be sent with a release; 0: not known"
        ),
        "ended_ago": or_null(NUMBER, "s"),
        "ended_at": or_null(TEXT, "ISO 8601"),
        "goals": {
            "anyOf": [listed(ref("Place")), {"type": "null"}],
            "description": "places that it drives to; null: not known; empty: many, which only"
            " the answer to GET /tasks/{task} has",
        },
    }
)
QUEUE = whole(
    {
        "vehicle": INTEGER,
        "running": or_null(INTEGER, "id of the running task"),
        "next": or_null(INTEGER, "id of the task that runs next"),
        "paused": or_null(REASON, "why it is paused; null: it is not"),
        "paused_words": or_null(TEXT),
        "paused_remedy": or_null(TEXT, "what a person can do about it"),
        "halt_epoch": said(INTEGER, "grows with each event that halts the rover"),
        "heartbeat_age": or_null(NUMBER, "s since the rover's heartbeat"),
        "shares_id": said(FLAG, "another rover has the same system id; it is ignored"),
        "gateway": or_null(TEXT, "gateway of a fleet that has the rover"),
        "waiting_count": said(INTEGER, "number of waiting tasks"),
        "capacity": said(INTEGER, "number of waiting tasks that there may be"),
        "counts": {
            "type": "object",
            "description": "number of tasks in each state",
            "additionalProperties": INTEGER,
        },
        "current": or_null(ref("Task")),
        "waiting": said(listed(ref("Task")), "in the order in which they run"),
        "more": said(INTEGER, "waiting tasks that are not listed"),
    }
)
QUEUE_CHANGE = whole(
    {name: part for name, part in QUEUE["properties"].items() if name != "waiting"}
    | {
        "order": {
            "type": "array",
            "description": "all listed waiting tasks in the order in which they run: id, position,"
            " time_to_start and time_to_finish (s; null: not known); a task that is not here does"
            " not wait any more",
            "items": {"type": "array", "items": MAYBE, "minItems": 4, "maxItems": 4},
        },
        "rows": said(
            listed(ref("Task")),
            "the waiting tasks that are new here, or changed in anything but the numbers of the"
            " order and halt_epoch; the others are as they were",
        ),
    }
)
SHAPE = whole(
    {
        "kind": {"type": "string", "enum": ["polygon", "circle"]},
        "inclusion": FLAG,
        "points": listed(ref("Place")),
        "centre": ref("Place"),
        "radius": said(NUMBER, "m"),
    },
    optional=("points", "centre", "radius"),
)
STOP = whole(
    {
        "number": INTEGER,
        "at": said(NUMBER, "seconds since 1970"),
        "vehicle": or_null(INTEGER, "null: all rovers"),
        "by": TEXT,
        "phase": {
            "type": "string",
            "enum": ["sent", "acknowledged", "standing", "refused", "unanswered"],
        },
        "acknowledged_after": or_null(NUMBER, "s"),
        "standing_after": or_null(NUMBER, "s"),
        "detail": or_null(TEXT),
        "tasks": said(listed(INTEGER), "ids of the tasks that it ended"),
    }
)
TEXT_FORM = whole(
    {
        "number": INTEGER,
        "at": said(NUMBER, "seconds since 1970"),
        "vehicle": INTEGER,
        "component": INTEGER,
        "severity": said(INTEGER, "0 (emergency) to 7 (debug)"),
        "words": TEXT,
    }
)
POINT: Schema = {
    "type": "array",
    "description": "seconds since 1970, north and east (m), heading (deg), task id",
    "items": or_null(NUMBER),
    "minItems": 5,
    "maxItems": 5,
}
KIND = whole(
    {
        "kind": TEXT,
        "meaning": TEXT,
        "numbers": listed(
            whole(
                {
                    "name": TEXT,
                    "unit": TEXT,
                    "meaning": TEXT,
                    "required": FLAG,
                    "least": MAYBE,
                    "most": MAYBE,
                }
            )
        ),
    }
)

SCHEMAS: dict[str, Schema] = {
    "Place": PLACE,
    "Battery": whole({"percent": or_null(INTEGER), "voltage": or_null(NUMBER, "V")}),
    "Remedy": whole(
        {
            "action": {"type": "string", "enum": ["resume", "release", "none"]},
            "words": TEXT,
        }
    ),
    "Vehicle": VEHICLE,
    "Vehicles": whole({"vehicles": listed(ref("Vehicle"))}),
    "Task": TASK,
    "Tasks": whole({"tasks": listed(ref("Task"))}),
    "Queue": QUEUE,
    "QueueChange": QUEUE_CHANGE,
    "Snapshot": whole(
        {
            "now": said(NUMBER, "time of the web process, seconds since 1970"),
            "reachable": said(FLAG, "the task server is heard"),
            "detail": or_null(TEXT, "why not"),
            "vehicles": listed(ref("Vehicle")),
            "queues": said(listed(ref("Queue")), "with up to 200 waiting tasks each"),
            "texts": said(listed(ref("Text")), "the latest 200, the newest last"),
            "stops": said(listed(ref("Stop")), "the latest 50 that were sent here"),
        }
    ),
    "VehicleStates": whole(
        {
            "now": said(NUMBER, "when this was made, seconds since 1970"),
            "since": said(
                NUMBER,
                "when the first change in it arrived, seconds since 1970; now - since is how long"
                " the web process held it back",
            ),
            "vehicles": listed(ref("Vehicle")),
        }
    ),
    "ServerState": whole(
        {
            "reachable": said(FLAG, "the task server is heard"),
            "detail": or_null(TEXT, "why not"),
        }
    ),
    "Alive": whole({}),
    "Stop": STOP,
    "Text": TEXT_FORM,
    "Texts": whole({"texts": listed(ref("Text"))}),
    "Track": whole({"points": listed(POINT)}),
    "Path": whole({"path": listed(ref("Place"))}),
    "Places": whole({"places": listed(ref("Place"))}),
    "Shape": SHAPE,
    "Fence": whole({"shapes": listed(ref("Shape"))}),
    "Count": whole({"items": INTEGER}),
    "Defaults": whole({"speed": said(NUMBER, "m/s"), "rate": said(NUMBER, "deg/s")}),
    "Plan": whole(
        {
            "items": INTEGER,
            "path": listed(ref("Place")),
            "length": or_null(NUMBER, "m"),
            "fence": listed(ref("Shape")),
            "rally": listed(ref("Place")),
        }
    ),
    "Timing": whole(
        {
            "rate": said(NUMBER, "Hz"),
            "count": INTEGER,
            "p50": or_null(NUMBER, "s"),
            "p99": or_null(NUMBER, "s"),
            "max": or_null(NUMBER, "s"),
            "late": INTEGER,
        }
    ),
    "Entries": {
        "type": "object",
        "properties": {
            "entries": listed(
                {
                    "type": "object",
                    "properties": {"number": INTEGER, "at": NUMBER, "message": TEXT},
                    "required": ["number", "at", "message"],
                }
            ),
            "next": or_null(INTEGER),
        },
        "required": ["entries"],
    },
    "Records": whole(
        {
            "records": listed(
                whole(
                    {
                        "name": TEXT,
                        "bytes": INTEGER,
                        "changed": said(NUMBER, "seconds since 1970"),
                        "files": listed(TEXT),
                    }
                )
            )
        }
    ),
    "Record": whole(
        {
            "begins": said(NUMBER, "seconds since 1970"),
            "ends": NUMBER,
            "vehicles": listed(
                whole(
                    {
                        "vehicle": INTEGER,
                        "points": listed(
                            {
                                "type": "array",
                                "description": "time, north and east (m), heading (deg), m/s",
                                "items": MAYBE,
                                "minItems": 5,
                                "maxItems": 5,
                            }
                        ),
                        "modes": said(
                            listed({"type": "array", "minItems": 3, "maxItems": 3}),
                            "time, mode, whether it was armed",
                        ),
                    }
                )
            ),
            "events": listed(
                whole(
                    {
                        "at": NUMBER,
                        "words": TEXT,
                        "kind": {"type": "string", "enum": ["event", "text"]},
                        "vehicle": or_null(INTEGER),
                        "task": or_null(INTEGER),
                    }
                )
            ),
        }
    ),
    "Session": whole(
        {
            "name": TEXT,
            "role": or_null(TEXT),
            "may": said(listed(TEXT), "what the server may accept, perhaps of your own tasks only"),
            "version": TEXT,
            "server": TEXT,
            "instance": said(TEXT, "new with each start of the web process"),
            "tiles": or_null(ref("Tiles")),
            "journal": FLAG,
            "records": FLAG,
            "goals": listed(ref("Kind")),
            "priority": whole({"least": INTEGER, "most": INTEGER, "default": INTEGER}),
            "label_bytes": INTEGER,
        }
    ),
    "Tiles": whole({"url": TEXT, "attribution": TEXT, "min_zoom": INTEGER, "max_zoom": INTEGER}),
    "Kind": KIND,
    "Problem": whole(
        {
            "type": TEXT,
            "title": TEXT,
            "status": INTEGER,
            "detail": TEXT,
            "reason": or_null(TEXT),
        }
    ),
}
