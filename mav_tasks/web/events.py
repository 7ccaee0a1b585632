"""The events of the stream: declared once, for the OpenAPI document and its tests. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mav_tasks.web.schemas import SCHEMAS

HOW = (
    "Server-sent events (WHATWG HTML, 9.2). Each has a name, and a JSON object as data. An event"
    " with an id is kept for some time: send the last id as Last-Event-ID, as browsers do, and the"
    " stream continues behind it. If that id is no longer kept, or you read too slowly, you get a"
    " snapshot instead, which replaces all that you know. Times are in seconds, places in metres"
    " or degrees."
)


@dataclass(frozen=True, slots=True)
class Event:
    """One kind of event. ``schema``: the name of its data's schema."""

    name: str
    schema: str
    meaning: str
    has_id: bool = True


EVENTS = (
    Event("snapshot", "Snapshot", "Everything, at the start and after a gap."),
    Event(
        "vehicles",
        "VehicleStates",
        "Rovers that have changed, at most 20 times a second, and all of them once a second. A slow"
        " reader gets only the latest states.",
        has_id=False,
    ),
    Event("queue", "QueueChange", "A queue has changed: its head, its order, and the new rows."),
    Event("task", "Task", "A task has changed, or made progress."),
    Event("text", "Text", "A text of a rover or the server."),
    Event("stop", "Stop", "A STOP that was sent here, at each change of its phase."),
    Event("server", "ServerState", "The task server fell silent, or is heard again."),
    Event("alive", "Alive", "Nothing has happened for 10 s, but the stream works.", has_id=False),
)


def description() -> str:
    """Return the description of all events: names, fields and units, as Markdown."""
    return "\n\n".join((HOW, *(_described(event) for event in EVENTS)))


def _described(event: Event) -> str:
    mark = "with an id" if event.has_id else "without an id"
    lines = [f"**{event.name}** ({event.schema}, {mark}): {event.meaning}"]
    parts: Mapping[str, Mapping[str, Any]] = SCHEMAS[event.schema]["properties"]
    lines += [f"- `{name}`: {_words_of(schema)}" for name, schema in parts.items()]
    return "\n".join(lines)


def _words_of(schema: Mapping[str, Any]) -> str:
    """Return the type of a field, and its meaning with its unit."""
    kind = _kind_of(schema)
    meaning = schema.get("description")
    return f"{kind}; {meaning}" if meaning else kind


def _kind_of(schema: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "anyOf" in schema:
        return " or ".join(_kind_of(each) for each in schema["anyOf"])
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if "array" in kinds:
        return f"list of {_kind_of(schema['items'])}"
    return " or ".join(kinds)
