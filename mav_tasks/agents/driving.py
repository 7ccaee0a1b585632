"""The tools that move and stop rovers: submit, cancel, release, stop, pause, resume."""

from typing import Any

from mav_tasks.agents import submission
from mav_tasks.agents.arguments import Argument
from mav_tasks.agents.forms import DONE, TASK, task_form
from mav_tasks.agents.reading import TASK_ID, VEHICLE_ID
from mav_tasks.agents.rovers import Rovers
from mav_tasks.agents.tool import Report, Tool, Values
from mav_tasks.client.goal_form import goal_schema
from mav_tasks.client.idempotency import LONGEST
from mav_tasks.tasks.task import MAX_PRIORITY

MOST_GOALS = 100
LONGEST_DELAY = 30 * 86_400  # s

EPOCH = Argument(
    "epoch",
    {
        "type": "integer",
        "minimum": 1,
        "description": "halt_epoch that you read in task or queue; refused if anything has "
        "stopped the rover since then: read again, and think again",
    },
    is_required=True,
)
SUBMISSION = (
    Argument(
        "goals",
        {
            "type": "array",
            "minItems": 1,
            "maxItems": MOST_GOALS,
            "items": goal_schema(),
            "description": "what the rover does, one goal after the other",
        },
        is_required=True,
    ),
    Argument(
        "idempotency_key",
        {
            "type": "string",
            "minLength": 1,
            "maxLength": LONGEST,
            "description": "a text of your own that names this task, such as a UUID; note it "
            "before you submit, and use it again if you submit again",
        },
        is_required=True,
    ),
    VEHICLE_ID,
    Argument(
        "priority",
        {
            "type": "integer",
            "minimum": 0,
            "maximum": MAX_PRIORITY,
            "description": "10 is the highest; default 5",
        },
    ),
    Argument(
        "after",
        {"type": "integer", "minimum": 1, "description": "id of a task that must complete first"},
    ),
    Argument(
        "start_in",
        {
            "type": "number",
            "minimum": 0,
            "maximum": LONGEST_DELAY,
            "description": "earliest start, s from now",
        },
    ),
    Argument(
        "deadline",
        {
            "type": "number",
            "minimum": 0,
            "maximum": LONGEST_DELAY,
            "description": "latest start, s from now; then the task expires",
        },
    ),
    Argument(
        "label",
        {"type": "string", "maxLength": 24, "description": "a name for people, up to 24 bytes"},
    ),
)
HOW = Argument(
    "how",
    {
        "type": "string",
        "enum": ["again", "remainder", "skip"],
        "description": "'remainder' finishes the task, 'again' repeats all of it from where the "
        "rover is, 'skip' drops it",
    },
    is_required=True,
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
    (VEHICLE_ID,),
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
            (TASK_ID,),
            TASK,
            _cancel,
            is_destructive=True,
        ),
        Tool(
            "release",
            "Release a held task",
            "Decide about a held task, which blocks its rover: finish it, repeat it, or drop it. "
            "Find out first why it is held. If the queue is paused, call resume, too.",
            (TASK_ID, HOW, EPOCH),
            TASK,
            _release,
            is_destructive=True,
        ),
        STOP,
        Tool(
            "pause",
            "Pause a rover",
            "Stop a rover; its task and its queue continue on resume.",
            (VEHICLE_ID,),
            DONE,
            _pause,
        ),
        Tool(
            "resume",
            "Resume a rover",
            "Let a rover drive its tasks again after a pause, a STOP or a takeover; needs the role "
            "'operator'. If a person has stopped the rover, ask that person first.",
            (VEHICLE_ID, EPOCH),
            DONE,
            _resume,
            is_destructive=True,
        ),
    )
