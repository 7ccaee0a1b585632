"""The answers of the tools, and their JSON schemas."""

import json
from collections.abc import Mapping
from typing import Any

from mav_tasks.agents.advice import advice_of, advice_on_queue
from mav_tasks.client import json_form
from mav_tasks.client.json_form import queue_json, task_json
from mav_tasks.client.values import QueueStatus, TaskStatus
from mav_tasks.config.setting_keys.schema import (
    FLAG,
    TEXT,
    Schema,
    an_object,
    listed,
    or_null,
    said,
)

#: parts of tasks, queues and rovers that agents are told of in advance: each word costs them
OF_A_TASK = "id vehicle what label state why progress time_to_start time_to_finish halt_epoch"
OF_A_FINISHED = "id vehicle what label state why ended_at"
OF_A_QUEUE = "vehicle paused halt_epoch waiting_count capacity"
OF_A_VEHICLE = (
    "vehicle kind mode armed heard north east latitude longitude heading speed position_age"
)
ADVICE = {"advice": said(TEXT, "what to do now; empty: nothing")}


def _some(parts: json_form.Parts, names: str, more: Mapping[str, Schema]) -> Schema:
    """Return the schema of an object with some parts, without the lists of their words."""
    schemas = ((name, parts[name][1]) for name in names.split())
    brief = {
        name: {key: value for key, value in schema.items() if key != "enum"}
        for name, schema in schemas
    }
    return an_object(brief | dict(more))


IS_OVER = {"is_over": said(FLAG, "whether it has ended, completed or not")}
TASK = _some(json_form.TASK, OF_A_TASK, IS_OVER | ADVICE)
FINISHED = _some(json_form.TASK, OF_A_FINISHED, {})
QUEUE = _some(
    json_form.QUEUE, OF_A_QUEUE, {"current": or_null(TASK), "waiting": listed(TASK)} | ADVICE
)
VEHICLE = _some(json_form.VEHICLE, OF_A_VEHICLE, {})
DONE = an_object({"done": said(TEXT, "what was done")})


def task_form(status: TaskStatus) -> dict[str, Any]:
    """Return a task, with what an agent can do about it."""
    return task_json(status) | {
        "is_over": status.is_over,
        "advice": advice_of(status),
    }


def queue_form(queue: QueueStatus) -> dict[str, Any]:
    """Return a queue, with what an agent can do about it and its tasks."""
    form = queue_json(queue)
    whys = {each["id"]: each["why"] for each in form["waiting"]}
    waiting = [task_form(each) | {"why": whys[each.id]} for each in queue.waiting]
    current = None if queue.current is None else task_form(queue.current)
    advice = advice_on_queue(queue)
    return form | {"current": current, "waiting": waiting, "advice": advice}


def result(form: Mapping[str, Any], *, is_error: bool = False) -> dict[str, Any]:
    """Return the result of a call: structured, and as text for agents that read only text."""
    return _of_call(json.dumps(form, ensure_ascii=False), is_error=is_error) | {
        "structuredContent": dict(form)
    }


def refusal(why: str) -> dict[str, Any]:
    """Return the result of a refused or unanswered call."""
    return _of_call(why, is_error=True)


def _of_call(text: str, *, is_error: bool) -> dict[str, Any]:
    content = [{"type": "text", "text": text}]
    return {"resultType": "complete", "content": content, "isError": is_error}
