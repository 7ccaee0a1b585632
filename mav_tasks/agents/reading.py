"""The tools that change nothing: vehicles, queue, history, task, wait."""

import asyncio
from collections.abc import Sequence
from typing import Any

from mav_tasks.agents.forms import (
    FINISHED,
    QUEUE,
    TASK,
    VEHICLE,
    queue_form,
    task_form,
)
from mav_tasks.agents.rovers import Rovers
from mav_tasks.agents.tool import Report, Run, Tool, Values
from mav_tasks.client.descriptions import needs_decision, state_of, what_of, why_of
from mav_tasks.client.handle import Task
from mav_tasks.client.json_form import task_json, vehicle_json
from mav_tasks.client.operations import OPERATION
from mav_tasks.client.parts import TASK_ID, VEHICLE_ID
from mav_tasks.client.values import TaskStatus
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.schema import Schema, an_object, listed
from mav_tasks.config.setting_keys.shapes import Number

LONGEST_WAIT = 300  # s
USUAL_WAIT = 30  # s; many programs of agents end a call after a minute
REPORTS = 1.0  # s between two reports of progress
LEAST_STEP = 1e-6  # between two reports

ROVER = Part("vehicle", VEHICLE_ID, "system id of the rover; can be left out if there is only one")
ID = Part("id", TASK_ID, "id of the task", True)
LIMIT = Part("limit", Number(0, 100, is_whole=True), "most tasks; default 20")
SECONDS = Part(
    "seconds", Number(0, LONGEST_WAIT, "s"), f"how long to wait at most; default {USUAL_WAIT}"
)


async def _vehicles(rovers: Rovers, _values: Values, _report: Report) -> dict[str, Any]:
    return {"vehicles": [vehicle_json(each) for each in await rovers.all()]}


async def _queue(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = await rovers.vehicle(values["vehicle"])
    client = await rovers.client()
    return queue_form(await client.queue(vehicle=vehicle, limit=_limit(values)))


async def _history(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = await rovers.vehicle(values["vehicle"])
    client = await rovers.client()
    tasks = await client.history(vehicle=vehicle, limit=_limit(values))
    return {"tasks": [task_json(each) for each in tasks]}


async def _task(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    return task_form(await rovers.status(values["id"]))


async def _wait(rovers: Rovers, values: Values, report: Report) -> dict[str, Any]:
    task = await rovers.task(values["id"])
    seconds = USUAL_WAIT if values["seconds"] is None else values["seconds"]
    try:
        async with asyncio.timeout(seconds):
            await _until_over(task, report)
    except TimeoutError:
        pass
    return task_form(await task.refresh())


async def _until_over(task: Task, report: Report) -> None:
    """Report progress until a task is over or held. A held task needs a release.

    The protocol wants each report to be above the one before; a task's progress may also fall.
    """
    told, before = -LEAST_STEP, ""
    async for status in task.updates(interval=REPORTS):
        line = _line(status)
        progress = max(status.progress or 0.0, told + LEAST_STEP)
        if line != before or progress > told + LEAST_STEP:
            told, before = progress, line
            await report(progress, line)
        if needs_decision(status):
            return


def _line(status: TaskStatus) -> str:
    why = f" ({why_of(status)})" if status.reason else ""
    return f"task {status.id}: {what_of(status)}: {state_of(status)}{why}"


def _limit(values: Values) -> int:
    return 20 if values["limit"] is None else values["limit"]


def _shows(
    name: str, title: str, arguments: Sequence[Part], returns: Schema, run: Run, *, of: str = ""
) -> Tool:
    """Return the tool of a declared operation; ``of``: its name there, if it is another one."""
    declared = OPERATION[of or name]
    about = f"{declared.summary}. {declared.advice}"
    return Tool(name, title, about, arguments, returns, run, is_reading=True)


READING = (
    _shows("vehicles", "Rovers", (), an_object({"vehicles": listed(VEHICLE)}), _vehicles),
    _shows("queue", "Queue", (ROVER, LIMIT), QUEUE, _queue),
    _shows(
        "history",
        "Finished tasks",
        (ROVER, LIMIT),
        an_object({"tasks": listed(FINISHED)}),
        _history,
    ),
    _shows("task", "Task", (ID,), TASK, _task, of="status"),
    Tool(
        "wait",
        "Wait for a task",
        "Wait until a task has ended, or until it is held, or for this many seconds. Then show the "
        "task as it is: if is_over is false, do what 'advice' says, or call wait again. "
        "A task that is held does not continue by itself: it needs release.",
        (ID, SECONDS),
        TASK,
        _wait,
        is_reading=True,
    ),
)
