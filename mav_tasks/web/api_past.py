"""Operations on the past: texts, the journal and recordings."""

import asyncio
from typing import Any

from starlette.responses import Response

from mav_tasks.client.parts import TASK_ID, VEHICLE_ID
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import LARGEST, Number
from mav_tasks.web.operation import Call, Operation
from mav_tasks.web.problems import not_found
from mav_tasks.web.services import Services

NO_RECORDS = "the web process shows no recordings: start it with --records FOLDER"
SINCE = Number(0, LARGEST, is_whole=True)
LIMIT = Part("limit", Number(1, 2000, is_whole=True), "at most this many")


def operations(services: Services) -> list[Operation]:
    """Return the operations."""

    async def texts(call: Call) -> Any:
        limit = call.query["limit"] or 200
        return {"texts": services.live.texts(before=call.query["before"], limit=limit)}

    async def journal(call: Call) -> Any:
        entries = await services.entries(
            task=call.query["task"],
            vehicle=call.query["vehicle"],
            after=call.query["after"],
            limit=call.query["limit"] or 200,
        )
        last = entries[-1]["number"] if entries else call.query["after"]
        return {"entries": entries, "next": last}

    async def records(_call: Call) -> Any:
        if services.records is None:
            raise not_found(NO_RECORDS)
        return {"records": await asyncio.to_thread(services.records.forms)}

    async def record(call: Call) -> Any:
        if services.records is None:
            raise not_found(NO_RECORDS)
        data = await services.records.run(str(call.path["record"]))
        return Response(data, media_type="application/json")

    return [
        Operation("GET", "/records", "Recorded runs, the newest first", records, answer="Records"),
        Operation(
            "GET",
            "/records/{record}",
            "One recorded run: where its rovers were, and what happened",
            record,
            answer="Record",
        ),
        Operation(
            "GET",
            "/texts",
            "Texts of rovers and the server, while this process ran",
            texts,
            query=[
                Part("before", SINCE, "number of a text; older ones"),
                LIMIT,
            ],
            answer="Texts",
        ),
        Operation(
            "GET",
            "/journal",
            "Events of the store: the latest of a day or of a task, or those after a number",
            journal,
            query=[
                Part("task", TASK_ID, "only of this task"),
                Part("vehicle", VEHICLE_ID, "only of this rover"),
                Part("after", SINCE, "the first ones after this event"),
                LIMIT,
            ],
            answer="Entries",
        ),
    ]
