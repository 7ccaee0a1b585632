"""``direct.py`` as it is written for MAVSDK's asyncio face."""

import asyncio
import json
from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkMessage
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync

from tests.interop.scripts.asyncio_common import arm, connected
from tests.interop.scripts.asyncio_waiting import Watch, wait_for
from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.facts import (
    COMPLETED,
    DIALECT,
    GOTO,
    METRES,
    NAN,
    SERVER,
    move,
    status_request,
)
from tests.interop.scripts.plans import raw_items

Heard = Watch[dict[str, Any]]


async def fields(direct: Any, kind: str) -> AsyncGenerator[dict[str, Any], None]:
    async for message in direct.subscribe_message(kind):
        yield json.loads(message.fields_json)


async def command(here: Circumstances, direct: Any, what: dict[str, Any]) -> Any:
    message = MavlinkMessage("COMMAND_LONG", 0, 0, 1, SERVER, json.dumps(what))
    ack = await here.attempt_async(direct.send_command, message)
    return json.loads(ack.fields_json)


async def move_as_a_task(here: Circumstances, direct: Any, statuses: Heard) -> int:
    """Submit a move, follow it to its end by TASK_STATUS; gives its id."""
    ack = await command(here, direct, move())
    assert ack["result"] == 0, ack
    task_id = int(ack["result_param2"])

    async def is_completed() -> bool:
        if here.is_lossy:  # the report of the end comes once, and may be lost: so ask for it
            answer = await command(here, direct, status_request(task_id))
            assert answer["result"] == 0, answer
        return any(status["state"] == COMPLETED for status in statuses.seen)

    await wait_for(is_completed, "the task's end")
    assert {status["task_id"] for status in statuses.seen} == {task_id}
    return task_id


async def main() -> None:
    async with connected() as (here, system, telemetry, home), AsyncExitStack() as open_:
        direct, action, raw = (
            MavlinkDirectAsync(system),
            ActionAsync(system),
            MissionRawAsync(system),
        )
        await direct.load_custom_xml(DIALECT.read_text(encoding="utf-8"))
        statuses, acks, mission_acks, currents = [
            await open_.enter_async_context(Watch(fields(direct, kind)))
            for kind in ("TASK_STATUS", "COMMAND_ACK", "MISSION_ACK", "MISSION_CURRENT")
        ]
        await arm(here, action, telemetry)
        task_id = await move_as_a_task(here, direct, statuses)
        print("task", task_id, "completed")

        north = home.latitude_deg + 1 / METRES
        await here.attempt_async(action.goto_location, north, home.longitude_deg, 0.0, NAN)
        await acks.until(lambda seen: any(ack["command"] == GOTO for ack in seen), "the ack")
        answers = [ack for ack in acks.seen if ack["command"] == GOTO]
        print("goto", sorted({(ack["result"], ack["result_param2"]) for ack in answers}))

        await here.attempt_async(raw.upload_mission, raw_items(home))
        await mission_acks.until(bool, "the ack of the mission")
        mission_id = mission_acks.seen[-1]["opaque_id"]
        await currents.until(
            lambda seen: seen and seen[-1]["mission_id"] == mission_id, "the mission's id"
        )
        print("mission", mission_id)


if __name__ == "__main__":
    asyncio.run(main())
