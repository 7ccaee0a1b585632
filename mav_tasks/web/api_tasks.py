"""Operations on tasks: submit and show."""

from typing import Any

from starlette.responses import Response

from mav_tasks.client.aio import Client
from mav_tasks.client.json_form import timing_json
from mav_tasks.client.operations import OPERATION
from mav_tasks.client.parts import (
    GOALS,
    KEY_TEXT,
)
from mav_tasks.client.plan_sources import Plan
from mav_tasks.client.terms import NEW, AnyRover
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.kinds.in_json import goals_of
from mav_tasks.web.goal_places import Place, places_of_goals, places_of_items
from mav_tasks.web.operation import Call, Operation
from mav_tasks.web.plan_text import NAME, text_part
from mav_tasks.web.services import Services
from mav_tasks.web.submissions import KEY, submit

FILE = (NAME, text_part("contents of a .plan or QGC WPL 110 file"))
KEYED = (Part(KEY, KEY_TEXT, "a text of yours: the same key makes no second task"),)
#: what the path names as the rover, and what it means for a new task
RUNS_ON = {
    "any": " of the rover that would begin it first; it may get another rover before it begins",
    "{vehicle}": "; answered once the task is durable",
}


def _named_by(call: Call) -> int | AnyRover:
    """Return the rover that the path names, or "any"."""
    return call.vehicle if "vehicle" in call.path else "any"


def operations(services: Services) -> list[Operation]:
    """Return the operations."""
    client, live, asks = services.client, services.live, services.asks

    async def add(call: Call, by: Client, plan: Plan, places: list[Place]) -> Any:
        task = await submit(
            by,
            plan,
            vehicle=_named_by(call),
            terms=call.body,
            headers=call.headers,
            by=call.identity.name,
        )
        live.remember_user(task.id, call.identity.name)
        if places:
            live.remember_places(task.id, places)
        live.hurry(task.vehicle)
        # asked on our own connection, which gets each change of the task from now on
        return live.task_form(await client.status(task.id, vehicle=task.vehicle))

    async def submit_task(call: Call, by: Client) -> Any:
        goals = goals_of(call.body["goals"])
        return await add(call, by, goals, places_of_goals(goals))

    async def submit_mission(call: Call, by: Client) -> Any:
        plan = call.body["plan"]
        return await add(call, by, plan, places_of_items(plan.items))

    async def preview(call: Call) -> Any:
        return Response(call.body["answer"], media_type="application/json")

    async def task(call: Call) -> Any:
        status = await services.status_of(call)
        await services.look_up_user(status.id)
        return live.task_form(status, is_whole=True)

    async def timing(call: Call) -> Any:
        status = await services.status_of(call)
        return timing_json(await client.timing(status.id, vehicle=status.vehicle))

    async def track(call: Call) -> Any:
        return {"points": live.tracks.of_task(call.task)}

    async def journal(call: Call) -> Any:
        return {"entries": await services.entries(task=call.task, limit=1000)}

    one = "/tasks/{task}"
    submissions = [
        Operation(
            "POST",
            f"/vehicles/{rover}/{name}",
            f"Submit {what} as one task{whose}",
            asks(handler),
            body=[*body, *NEW],
            reading=reading,
            answer="Task",
            status=201,
            headers=KEYED,
        )
        for rover, whose in RUNS_ON.items()
        for name, what, handler, body, reading in (
            ("tasks", "goals", submit_task, (GOALS,), ""),
            ("missions", "a mission file", submit_mission, FILE, "plan"),
        )
    ]
    return [
        *submissions,
        Operation(
            "POST",
            "/plans",
            "Read a mission file and show its path; nothing is sent to a rover",
            preview,
            body=FILE,
            answer="Plan",
            reading="preview",
        ),
        Operation("GET", one, OPERATION["status"].summary, task, answer="Task"),
        Operation(
            "GET",
            f"{one}/timing",
            "How evenly the setpoints of a task left",
            timing,
            answer="Timing",
        ),
        Operation(
            "GET",
            f"{one}/track",
            "Where the rover drove the task, while this process ran",
            track,
            answer="Track",
        ),
        Operation("GET", f"{one}/journal", "What happened to a task", journal, answer="Entries"),
    ]
