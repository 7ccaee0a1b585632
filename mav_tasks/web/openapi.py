"""The OpenAPI 3.1 document of the API, from its operations. Pure."""

import re
from collections.abc import Iterable
from importlib.metadata import version
from typing import Any

from mav_tasks.config.setting_keys.parts import Part, schema_of
from mav_tasks.config.setting_keys.schema import ref
from mav_tasks.web.operation import ROOT, Operation
from mav_tasks.web.problems import MEDIA_TYPE
from mav_tasks.web.schemas import SCHEMAS

INTRODUCTION = (
    "Tasks of MAVLink rovers. SI units, angles in degrees clockwise, times in seconds. Requests"
    " that let a rover move carry the halt_epoch that you have read; the server refuses them after"
    " a newer halt."
)
EVENTS = "text/event-stream"
PATH_NAMES = {
    "vehicle": "system id of a rover",
    "task": "id of a task",
    "record": "name of a recorded run",
}


def document_of(operations: Iterable[Operation]) -> dict[str, Any]:
    """Return the document."""
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        paths.setdefault(operation.path, {})[operation.method.lower()] = _described(operation)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "mav-tasks",
            "version": version("mav-tasks"),
            "description": INTRODUCTION,
        },
        "servers": [{"url": ROOT}],
        "security": [{}, {"token": []}],
        "paths": paths,
        "components": {
            "schemas": SCHEMAS,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _described(operation: Operation) -> dict[str, Any]:
    named = re.findall(r"{(\w+)}", operation.path)
    parameters = [
        {
            "name": name,
            "in": "path",
            "required": True,
            "description": PATH_NAMES[name],
            "schema": {"type": "string" if name == "record" else "integer"},
        }
        for name in named
    ]
    parameters += [_parameter(part, "query") for part in operation.query]
    parameters += [_parameter(part, "header") for part in operation.headers]
    described: dict[str, Any] = {
        "operationId": _id_of(operation),
        "summary": operation.summary,
        "parameters": parameters,
        "responses": _answers(operation),
    }
    if operation.description:
        described["description"] = operation.description
    if operation.body is not None:
        schema = schema_of(operation.body)
        for part in operation.body:
            if not part.is_required:  # null is "not given"
                named = schema["properties"][part.name]
                named["type"] = [named["type"], "null"]
        described["requestBody"] = {
            "required": bool(schema["required"]),
            "content": {"application/json": {"schema": schema}},
        }
    return described


def _answers(operation: Operation) -> dict[str, Any]:
    problem = {"description": "a problem", "content": {MEDIA_TYPE: {"schema": ref("Problem")}}}
    if not operation.answer:
        return {"204": {"description": "done"}, "default": problem}
    if operation.answer == "Events":
        content: dict[str, Any] = {EVENTS: {"schema": {"type": "string"}}}
    else:
        content = {"application/json": {"schema": ref(operation.answer)}}
    return {
        str(operation.status): {"description": operation.summary, "content": content},
        "default": problem,
    }


def _parameter(part: Part, place: str) -> dict[str, Any]:
    return {
        "name": part.name,
        "in": place,
        "required": part.is_required,
        "description": part.about,
        "schema": part.shape.schema(),
    }


def _id_of(operation: Operation) -> str:
    """Return a name for generated clients: "post_vehicles_tasks"."""
    words = re.findall(r"{?\w+}?", operation.path)
    parts = [f"by_{word[1:-1]}" if word.startswith("{") else word for word in words]
    return "_".join((operation.method.lower(), *parts))
