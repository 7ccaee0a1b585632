"""The answers of the tools, and their JSON schemas. Pure."""

import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from mav_tasks.agents.advice import advice_of, advice_on_queue
from mav_tasks.client.descriptions import end_of
from mav_tasks.client.json_form import history_json, queue_json, task_json
from mav_tasks.client.values import QueueStatus, TaskStatus

Schema = Mapping[str, Any]

TEXT: Schema = {"type": "string"}
WHOLE: Schema = {"type": "integer"}
YES_OR_NO: Schema = {"type": "boolean"}
SOME_TEXT: Schema = {"type": ["string", "null"]}
SOME_WHOLE: Schema = {"type": ["integer", "null"]}
SOME_NUMBER: Schema = {"type": ["number", "null"]}
SOME_YES_OR_NO: Schema = {"type": ["boolean", "null"]}


def an_object(**properties: Schema) -> dict[str, Any]:
    """Return the schema of an object with these properties, and maybe others."""
    return {
        "type": "object",
        "properties": {name: dict(each) for name, each in properties.items()},
        "required": list(properties),
    }


def a_list(of: Schema) -> dict[str, Any]:
    """Return the schema of a list."""
    return {"type": "array", "items": dict(of)}


def described(schema: Schema, words: str) -> dict[str, Any]:
    """Return a schema with a description."""
    return {**schema, "description": words}


TASK = an_object(
    id=WHOLE,
    vehicle=WHOLE,
    what=TEXT,
    label=SOME_TEXT,
    state=TEXT,
    why=described(SOME_TEXT, "why it is in this state"),
    is_over=described(YES_OR_NO, "whether it has ended, completed or not"),
    advice=described(TEXT, "what to do now; empty: nothing"),
    progress=described(SOME_NUMBER, "0 to 1"),
    time_to_start=described(SOME_NUMBER, "s"),
    time_to_finish=described(SOME_NUMBER, "s"),
    halt_epoch=described(WHOLE, "the epoch for resume and release"),
)
FINISHED = an_object(
    id=WHOLE,
    vehicle=WHOLE,
    what=TEXT,
    label=SOME_TEXT,
    state=TEXT,
    why=SOME_TEXT,
    ended_at=SOME_TEXT,
)
QUEUE = an_object(
    vehicle=WHOLE,
    paused=described(SOME_TEXT, "why no task runs until resume; null: it is not paused"),
    halt_epoch=described(WHOLE, "the epoch for resume and release"),
    advice=described(TEXT, "what to do now; empty: nothing"),
    current={"anyOf": [TASK, {"type": "null"}]},
    waiting=a_list(TASK),
    waiting_count=WHOLE,
    capacity=WHOLE,
)
VEHICLE = an_object(
    vehicle=WHOLE,
    kind=TEXT,
    mode=TEXT,
    armed=SOME_YES_OR_NO,
    heard=described(YES_OR_NO, "whether the rover is heard now"),
    north=described(SOME_NUMBER, "m from the origin of its local frame"),
    east=described(SOME_NUMBER, "m from the origin of its local frame"),
    latitude=SOME_NUMBER,
    longitude=SOME_NUMBER,
    heading=described(SOME_NUMBER, "degrees, clockwise from north"),
    speed=described(SOME_NUMBER, "m/s"),
)
DONE = an_object(done=described(TEXT, "what was done"))


def task_form(status: TaskStatus) -> dict[str, Any]:
    """Return a task, with what an agent can do about it."""
    return task_json(status) | {
        "why": end_of(status) or None,
        "is_over": status.is_over,
        "advice": advice_of(status),
        "halt_epoch": status.halt_epoch,
    }


def queue_form(queue: QueueStatus) -> dict[str, Any]:
    """Return a queue, with what an agent can do about it and its tasks."""
    form = queue_json(queue)
    whys = {each["id"]: each["why"] for each in form["waiting"]}
    waiting = [task_form(each) | {"why": whys[each.id]} for each in queue.waiting]
    current = None if queue.current is None else task_form(queue.current)
    advice = advice_on_queue(queue)
    return form | {"current": current, "waiting": waiting, "advice": advice}


def history_form(tasks: Sequence[TaskStatus], *, now: datetime) -> dict[str, Any]:
    """Return finished tasks, newest first."""
    return {"tasks": [history_json(each, now=now) for each in tasks]}


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
