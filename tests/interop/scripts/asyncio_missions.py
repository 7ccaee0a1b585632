"""``missions.py`` as it is written for MAVSDK's asyncio face."""

import asyncio
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync

from tests.interop.scripts.asyncio_common import arm, connected
from tests.interop.scripts.asyncio_waiting import Watch, wait_for, wait_for_motion
from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.facts import METRES, NAN
from tests.interop.scripts.plans import places, plan, raw_items
from tests.interop.scripts.progress import is_told_to_the_end, pairs


async def raw_mission(here: Circumstances, system: Any, telemetry: Any, home: Any) -> None:
    raw = MissionRawAsync(system)
    await here.attempt_async(raw.upload_mission, raw_items(home))
    back = await here.attempt_async(raw.download_mission)
    print("raw downloaded", places(back, home, here.persona)[-3:])
    async with Watch(raw.subscribe_mission_progress()) as progress:
        await here.attempt_async(raw.start_mission)
        await progress.until(lambda seen: seen and seen[-1].current >= 2, "an item")
        await here.attempt_async(raw.pause_mission)
        await wait_for_motion(telemetry.subscribe_velocity_ned(), moves=False)
        await here.attempt_async(raw.set_current_mission_item, 3)
        await here.attempt_async(raw.start_mission)
        await wait_for(raw.is_mission_finished, "the end")
        await progress.until(is_told_to_the_end, "the last item")
        print("raw progress", set(pairs(progress.seen)))
    await here.attempt_async(raw.clear_mission)


async def mission(here: Circumstances, system: Any, home: Any) -> None:
    plugin = MissionAsync(system)
    async with Watch(plugin.subscribe_mission_progress()) as progress:
        await here.attempt_async(plugin.upload_mission, plan(home))
        back = await here.attempt_async(plugin.download_mission)
        print("downloaded", len(back.mission_items))
        await here.attempt_async(plugin.start_mission)
        await progress.until(lambda seen: seen and seen[-1].current >= 1, "the first item")
        await here.attempt_async(plugin.pause_mission)
        await here.attempt_async(plugin.set_current_mission_item, 1)
        await here.attempt_async(plugin.start_mission)
        await wait_for(plugin.is_mission_finished, "the end")
        await progress.until(is_told_to_the_end, "the last item")
        print("progress", pairs(progress.seen))
    await here.attempt_async(plugin.clear_mission)


async def actions(here: Circumstances, system: Any, telemetry: Any, home: Any) -> None:
    action = ActionAsync(system)
    place = (home.latitude_deg + 7 / METRES, home.longitude_deg, 0.0, NAN)
    await here.attempt_async(action.goto_location, *place)
    await wait_for_motion(telemetry.subscribe_velocity_ned(), moves=True)
    await here.attempt_async(action.hold)
    await wait_for_motion(telemetry.subscribe_velocity_ned(), moves=False)
    await here.attempt_async(action.return_to_launch)
    await wait_for_motion(telemetry.subscribe_velocity_ned(), moves=True)


async def main() -> None:
    async with connected() as (here, system, telemetry, home):
        await arm(here, ActionAsync(system), telemetry)
        await raw_mission(here, system, telemetry, home)
        await mission(here, system, home)
        await actions(here, system, telemetry, home)


if __name__ == "__main__":
    asyncio.run(main())
