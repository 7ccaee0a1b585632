"""The tools that move and stop rovers: submit, and those made from declared operations."""

from dataclasses import replace
from typing import Any

from mav_tasks.agents import submission
from mav_tasks.agents.forms import DONE, TASK, task_form
from mav_tasks.agents.reading import ID, ROVER
from mav_tasks.agents.rovers import Rovers
from mav_tasks.agents.tool import Report, Tool, Values
from mav_tasks.client.asking import ask, parts_of
from mav_tasks.client.operations import OPERATION, OPERATIONS, Operation
from mav_tasks.client.parts import GOALS, KEY_TEXT
from mav_tasks.client.terms import OF_NEW
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Items
from mav_tasks.kinds.in_json import goal_schema

SUBMISSION = (
    Part("goals", Items(goal_schema(), 1, 100), GOALS.meaning, True),
    Part(
        "idempotency_key",
        KEY_TEXT,
        "a text of your own that names this task, such as a UUID; note it before you submit, and "
        "use it again if you submit again",
        True,
    ),
    ROVER,
    OF_NEW["priority"],
    OF_NEW["after"],
    replace(OF_NEW["delay"], name="start_in"),
    OF_NEW["deadline"],
    OF_NEW["label"],
)


async def _submit(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = await rovers.vehicle(values["vehicle"])
    return task_form(await submission.submit(rovers, submission.Wish.of(vehicle, values)))


async def _stop(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = values["vehicle"]  # any: STOP is never too much
    await rovers.unfound.stop(vehicle=vehicle)
    which = "every rover" if vehicle is None else f"rover {vehicle}"
    return {"done": f"STOP is in force for {which}: no task runs until an operator resumes"}


def _made(operation: Operation) -> Tool:
    """Return the tool of an operation: with the parts that it requires."""
    parts = [part for part in parts_of(operation) if part.is_required]
    is_of_rover = operation.about == "rover"

    async def of_rover(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
        vehicle = await rovers.vehicle(values.pop("vehicle"))
        await ask(await rovers.client(), operation, values, vehicle=vehicle)
        return {"done": f"rover {vehicle}: {operation.done}"}

    async def of_task(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
        client = await rovers.client()
        status = await rovers.status(values.pop("id"))
        await ask(client, operation, values, vehicle=status.vehicle, task=status.id)
        return task_form(await client.status(status.id, vehicle=status.vehicle))

    return Tool(
        operation.name,
        operation.summary,
        f"{operation.summary}. {operation.advice}".strip(),
        (ROVER if is_of_rover else ID, *parts),
        DONE if is_of_rover else TASK,
        of_rover if is_of_rover else of_task,
        is_destructive=not operation.is_halt,
    )


STOP = Tool(
    "stop",
    "STOP",
    f"{OPERATION['stop'].summary}. {OPERATION['stop'].advice}",
    (ROVER,),
    DONE,
    _stop,
    is_destructive=True,
)


def driving(limits: str) -> tuple[Tool, ...]:
    """Return the tools that move and stop rovers; ``limits``: those of the agents' key, or ""."""
    own = f" The server refuses what is beyond your limits: {limits}." if limits else ""
    return (
        Tool(
            "submit",
            "Submit a task",
            "Submit a task: the rover drives its goals in order, after the tasks before it. "
            "Returns at once, with the task's id; call wait to follow it. The same "
            "idempotency_key with the same content is the same task, so if you have no answer, or "
            "do not know whether you have submitted it, submit exactly the same again: it is not "
            "driven twice. To drive the same again on purpose, use a new key. The rover does not "
            f"see obstacles.{own}",
            SUBMISSION,
            TASK,
            _submit,
            is_destructive=True,
            makes_a_task=True,
        ),
        *(
            STOP if each is OPERATION["stop"] else _made(each)
            for each in OPERATIONS
            if not each.no_tool
        ),
    )
