"""The tools that move and stop rovers: submit, cancel, release, stop, pause, resume."""

from typing import Any

from mav_tasks.agents import submission
from mav_tasks.agents.forms import DONE, TASK, task_form
from mav_tasks.agents.reading import ID, ROVER
from mav_tasks.agents.rovers import Rovers
from mav_tasks.agents.tool import Report, Tool, Values
from mav_tasks.client.parts import (
    AFTER,
    DEADLINE,
    DELAY,
    EPOCH,
    GOALS,
    HOW,
    KEY_TEXT,
    LABEL,
    PRIORITY,
)
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Items, Number
from mav_tasks.kinds.in_json import goal_schema

SOON = Number(0, 30 * 86_400, "s")
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
    PRIORITY,
    AFTER,
    Part("start_in", SOON, DELAY.meaning),
    Part("deadline", SOON, DEADLINE.meaning),
    LABEL,
)


async def _submit(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = await rovers.vehicle(values["vehicle"])
    return task_form(await submission.submit(rovers, submission.Wish.of(vehicle, values)))


async def _cancel(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    task = await rovers.task(values["id"])
    await task.cancel()
    return task_form(await task.refresh())


async def _release(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    client = await rovers.client()
    status = await rovers.status(values["id"])
    await client.release(status.id, values["how"], epoch=values["epoch"], vehicle=status.vehicle)
    return task_form(await client.status(status.id, vehicle=status.vehicle))


async def _stop(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = values["vehicle"]  # any: STOP is never too much
    await rovers.unfound.stop(vehicle=vehicle)
    which = "every rover" if vehicle is None else f"rover {vehicle}"
    return {"done": f"STOP is in force for {which}: no task runs until an operator resumes"}


async def _pause(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = await rovers.vehicle(values["vehicle"])
    await (await rovers.client()).pause(vehicle=vehicle)
    return {"done": f"rover {vehicle}: paused; its task continues on resume"}


async def _resume(rovers: Rovers, values: Values, _report: Report) -> dict[str, Any]:
    vehicle = await rovers.vehicle(values["vehicle"])
    await (await rovers.client()).resume(epoch=values["epoch"], vehicle=vehicle)
    return {"done": f"rover {vehicle}: resumed"}


STOP = Tool(
    "stop",
    "STOP",
    "Stop every rover at once, or the named one. If in doubt, call it: it needs no permission. The "
    "running task ends; no task runs until resume, which needs the role 'operator'.",
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
        Tool(
            "cancel",
            "Cancel a task",
            "Cancel a task. If it is being driven, the rover stops; the next task then starts.",
            (ID,),
            TASK,
            _cancel,
            is_destructive=True,
        ),
        Tool(
            "release",
            "Release a held task",
            "Decide about a held task, which blocks its rover: finish it, repeat it, or drop it. "
            "Find out first why it is held. If the queue is paused, call resume, too.",
            (ID, HOW, EPOCH),
            TASK,
            _release,
            is_destructive=True,
        ),
        STOP,
        Tool(
            "pause",
            "Pause a rover",
            "Stop a rover; its task and its queue continue on resume.",
            (ROVER,),
            DONE,
            _pause,
        ),
        Tool(
            "resume",
            "Resume a rover",
            "Let a rover drive its tasks again after a pause, a STOP or a takeover; needs the role "
            "'operator'. If a person has stopped the rover, ask that person first.",
            (ROVER, EPOCH),
            DONE,
            _resume,
            is_destructive=True,
        ),
    )
