"""Operations on rovers: their state, STOP, queue, fence and rally points."""

import asyncio

from mav_tasks.client.aio import Client
from mav_tasks.client.asking import parts_of
from mav_tasks.client.fence_form import circle_of, polygon_of, shapes_of
from mav_tasks.client.operations import OPERATION
from mav_tasks.client.parts import VEHICLE_ID
from mav_tasks.config.setting_keys.parts import Part, schema_of
from mav_tasks.config.setting_keys.shapes import LARGEST, Items, Number, Record
from mav_tasks.kinds.goto import ON_EARTH
from mav_tasks.plans import PlanFile
from mav_tasks.web.goal_places import places_of_items
from mav_tasks.web.operation import Call, Handler, Operation
from mav_tasks.web.plan_text import NAME, text_part
from mav_tasks.web.problems import invalid
from mav_tasks.web.services import Services
from mav_tasks.web.stops import Stop
from mav_tasks.web.users import Line

SPOT = schema_of(ON_EARTH) | {"additionalProperties": True}
FENCE = [
    NAME,
    text_part("contents of a .plan file with a fence", is_required=False),
    Part("circle", Record(), "stay inside: latitude and longitude (deg) and radius (m)"),
    Part("polygon", Items(SPOT, 3, 500), "stay inside: three or more places"),
]
RALLY = [NAME, text_part("contents of a .plan file with rally points")]


def operations(services: Services) -> list[Operation]:
    """Return the operations."""
    client, live, asks = services.client, services.live, services.asks
    known = services.rover_of

    async def vehicles(_call: Call) -> object:
        return {"vehicles": live.vehicle_forms()}

    async def vehicle(call: Call) -> object:
        return live.vehicle_forms({known(call)})[0]

    async def stop(call: Call) -> object:
        rover = call.body["vehicle"]
        clear = bool(call.body["clear"])

        async def send(line: Line) -> Stop:
            return await live.stops.stop(rover, clear=clear, by=call.identity.name, line=line)

        return (await services.halted(call, send)).form()

    async def queue(call: Call) -> object:
        limit = call.query["limit"]
        found = await client.queue(vehicle=known(call), limit=100 if limit is None else limit)
        return live.queue_form(found)

    async def history(call: Call) -> object:
        limit = call.query["limit"]
        tasks = await client.history(vehicle=known(call), limit=50 if limit is None else limit)
        return {"tasks": [live.task_form(each) for each in tasks]}

    async def defaults(call: Call) -> object:
        rover = known(call)
        speed, rate = await asyncio.gather(
            client.parameter("TSK_SPEED", vehicle=rover),
            client.parameter("TSK_TURN", vehicle=rover),
        )
        return {"speed": round(speed, 3), "rate": round(rate, 3)}

    async def track(call: Call) -> object:
        return {"points": live.tracks.of_vehicle(known(call), since=call.query["since"] or 0.0)}

    async def mission(call: Call) -> object:
        items = await client.mission(vehicle=known(call))
        return {"path": places_of_items(items)}

    async def fence(call: Call) -> object:
        return {"shapes": shapes_of(await client.fence_file(vehicle=known(call)))}

    async def set_fence(call: Call, client: Client) -> object:
        plan = _fence_of(call)
        return {"items": await client.set_fence(plan, vehicle=known(call))}

    async def clear_fence(call: Call, client: Client) -> None:
        await client.set_fence(PlanFile((), None, (), ()), vehicle=known(call))

    async def rally(call: Call) -> object:
        items = await client.rally_points(vehicle=known(call))
        places = [{"latitude": item.x / 1e7, "longitude": item.y / 1e7} for item in items]
        return {"places": places}

    async def set_rally(call: Call, client: Client) -> object:
        plan = call.body["plan"]
        return {"items": await client.set_rally_points(plan, vehicle=known(call))}

    one = "/vehicles/{vehicle}"
    return [
        _shows("vehicles", "/vehicles", vehicles, "Vehicles"),
        Operation("GET", one, "One rover", vehicle, answer="Vehicle"),
        Operation(
            "POST",
            "/stop",
            OPERATION["stop"].summary,
            stop,
            body=[
                Part("vehicle", VEHICLE_ID, "the rover; all if not given"),
                *parts_of(OPERATION["stop"]),
            ],
            answer="Stop",
        ),
        _shows("queue", f"{one}/queue", queue, "Queue"),
        _shows("history", f"{one}/history", history, "Tasks"),
        Operation(
            "GET",
            f"{one}/defaults",
            "Speed and turn rate of goals that name none, unless DO_CHANGE_SPEED has set another",
            defaults,
            answer="Defaults",
        ),
        Operation(
            "GET",
            f"{one}/track",
            "Where the rover has been while this process ran",
            track,
            query=[Part("since", Number(0, LARGEST, "s"), "since 1970")],
            answer="Track",
        ),
        Operation("GET", f"{one}/mission", "The staged mission", mission, answer="Path"),
        Operation("GET", f"{one}/fence", "The fence", fence, answer="Fence"),
        Operation(
            "PUT",
            f"{one}/fence",
            "Set the fence",
            asks(set_fence),
            body=FENCE,
            answer="Count",
            reading="plan",
        ),
        Operation("DELETE", f"{one}/fence", "Remove the fence", asks(clear_fence)),
        Operation("GET", f"{one}/rally", "The rally points", rally, answer="Places"),
        Operation(
            "PUT",
            f"{one}/rally",
            "Set the rally points",
            asks(set_rally),
            body=RALLY,
            answer="Count",
            reading="plan",
        ),
    ]


def _shows(name: str, path: str, handler: Handler, answer: str) -> Operation:
    declared = OPERATION[name]
    summary, query = declared.summary, parts_of(declared)
    return Operation("GET", path, summary, handler, query=query, answer=answer)


def _fence_of(call: Call) -> PlanFile:
    """Return the fence of a request. Raise Problem unless it has exactly one form of it."""
    given = [name for name in ("text", "circle", "polygon") if call.body[name] is not None]
    if len(given) != 1:
        raise invalid("expected one of text, circle, polygon")
    if given == ["text"]:
        plan: PlanFile = call.body["plan"]
        return plan
    value = call.body[given[0]]
    return circle_of(value) if given == ["circle"] else polygon_of(value)
