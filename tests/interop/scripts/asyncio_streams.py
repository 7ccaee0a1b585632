"""``streams.py`` as it is written for MAVSDK's asyncio face."""

import asyncio
from contextlib import AsyncExitStack

from mavsdk.asyncio.plugins.action import ActionAsync

from tests.interop.scripts.asyncio_common import arm, connected
from tests.interop.scripts.asyncio_waiting import Watch
from tests.interop.scripts.facts import METRES, NAN, OFFBOARD
from tests.interop.scripts.heard import STREAMS, is_told_of_a_task, tell


async def main() -> None:
    async with connected() as (here, system, telemetry, home), AsyncExitStack() as open_:
        watches = {
            name: await open_.enter_async_context(Watch(getattr(telemetry, f"subscribe_{name}")()))
            for name in STREAMS
        }
        action = ActionAsync(system)
        await arm(here, action, telemetry)
        north = home.latitude_deg + 1 / METRES
        place = (north, home.longitude_deg, 0.0, NAN)
        await here.attempt_async(action.goto_location, *place)
        await watches["flight_mode"].until(lambda seen: OFFBOARD in seen, "the mode of a task")
        await watches["position"].until(
            lambda seen: seen and abs(seen[-1].latitude_deg - north) < 1e-6, "arrival"
        )
        texts = watches["status_text"]
        if here.is_lossy:  # each text comes once: go there again until one has come
            while not is_told_of_a_task(texts.seen):
                await here.attempt_async(action.goto_location, *place)
                await asyncio.sleep(1.0)
        else:
            await texts.until(
                lambda seen: any("Task 1 done" in each.text for each in seen), "the task's text"
            )
        for name, watch in watches.items():
            await watch.until(bool, name)
        tell({name: watch.seen for name, watch in watches.items()}, here.persona, home)


if __name__ == "__main__":
    asyncio.run(main())
