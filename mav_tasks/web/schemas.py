"""The JSON schemas of the API's answers, as ``forms`` and the handlers make them."""

from mav_tasks.client.json_form import QUEUE, TASK, TIMING, VEHICLE, schemas_of
from mav_tasks.config.setting_keys.schema import (
    FLAG,
    INTEGER,
    NUMBER,
    TEXT,
    Schema,
    listed,
    or_null,
    ref,
    said,
    whole,
    words,
)

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

#: parts of a rover that the page has in another form
OTHERWISE = ("position_age", "battery", "voltage")
A_VEHICLE = whole(
    {name: part for name, part in schemas_of(VEHICLE).items() if name not in OTHERWISE}
    | {
        "data_age": VEHICLE["position_age"][1],
        "battery": or_null(ref("Battery")),
        "prearm": said(listed(TEXT), "what those checks reported lately"),
        "control": said(
            words(("tasks", "paused", "taken over", "stopped", "silent")), "what controls it"
        ),
        "control_words": TEXT,
        "goal": or_null(ref("Place")),
        "origin": or_null(ref("Place"), "origin of its local frame"),
    }
)
A_TASK = whole(
    schemas_of(TASK)
    | {
        "remedy": or_null(ref("Remedy"), "what the user can do about it"),
        "submitted_by": said(TEXT, "who submitted it, in words"),
        "goals": said(
            {"anyOf": [listed(ref("Place")), {"type": "null"}]},
            "places that it drives to; null: not known; empty: many, which only"
            " the answer to GET /tasks/{task} has",
        ),
    }
)
A_QUEUE = whole(
    schemas_of(QUEUE)
    | {
        "paused_words": or_null(TEXT),
        "paused_remedy": or_null(TEXT, "what a person can do about it"),
        "more": said(INTEGER, "waiting tasks that are not listed"),
    }
)
QUEUE_CHANGE = whole(
    {name: part for name, part in A_QUEUE["properties"].items() if name != "waiting"}
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
        "kind": words(("polygon", "circle")),
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
        "phase": words(("sent", "acknowledged", "standing", "refused", "unanswered")),
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
PART = whole(
    {
        "name": TEXT,
        "type": said(TEXT, "as in a JSON schema"),
        "unit": TEXT,
        "meaning": TEXT,
        "required": FLAG,
        "least": MAYBE,
        "most": MAYBE,
        "words": said(listed(TEXT), "what it may be; none: anything of its type"),
    }
)
KIND = whole({"kind": TEXT, "title": TEXT, "meaning": TEXT, "numbers": listed(ref("Part"))})

SCHEMAS: dict[str, Schema] = {
    "Place": PLACE,
    "Battery": whole({"percent": or_null(INTEGER), "voltage": or_null(NUMBER, "V")}),
    "Remedy": whole(
        {
            "action": words(("resume", "release", "none")),
            "words": TEXT,
        }
    ),
    "Vehicle": A_VEHICLE,
    "Vehicles": whole({"vehicles": listed(ref("Vehicle"))}),
    "Task": A_TASK,
    "Tasks": whole({"tasks": listed(ref("Task"))}),
    "Queue": A_QUEUE,
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
    "Timing": whole(schemas_of(TIMING)),
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
                        "kind": words(("event", "text")),
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
            "terms": said(listed(ref("Part")), "what can be said of when and how a new task runs"),
            "changes": said(listed(ref("Part")), "what can be changed of that later"),
            "priority": whole({"least": INTEGER, "most": INTEGER, "default": INTEGER}),
            "label_bytes": INTEGER,
        }
    ),
    "Tiles": whole({"url": TEXT, "attribution": TEXT, "min_zoom": INTEGER, "max_zoom": INTEGER}),
    "Kind": KIND,
    "Part": PART,
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
