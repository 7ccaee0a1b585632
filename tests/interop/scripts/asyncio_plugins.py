"""``plugins.py`` as it is written for MAVSDK's asyncio face."""

import asyncio
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, VelocityBodyYawspeed
from mavsdk.asyncio.plugins.param import ParamAsync

from tests.interop.scripts.asyncio_common import arm, connected
from tests.interop.scripts.asyncio_waiting import first
from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.facts import LEAD
from tests.interop.scripts.plans import fence


async def geofence(here: Circumstances, system: Any, home: Any) -> None:
    plugin = GeofenceAsync(system)
    await here.attempt_async(plugin.upload_geofence, fence(home))
    back = await here.attempt_async(plugin.download_geofence)
    print("fence", [len(polygon.points) for polygon in back.polygons])
    await here.attempt_async(plugin.clear_geofence)
    print("fences", len((await here.attempt_async(plugin.download_geofence)).polygons))


async def parameters(here: Circumstances, system: Any) -> None:
    plugin = ParamAsync(system)
    (real, real_value), (integer, integer_value) = here.persona.real, here.persona.integer
    before = await here.attempt_async(plugin.get_param_int, integer)
    await here.attempt_async(plugin.set_param_float, real, real_value)
    await here.attempt_async(plugin.set_param_int, integer, integer_value)
    assert await here.attempt_async(plugin.get_param_float, real) == real_value
    assert await here.attempt_async(plugin.get_param_int, integer) == integer_value
    everything = await here.attempt_async(plugin.get_all_params)
    integers = {each.name: each.value for each in everything.int_params}
    reals = {each.name: each.value for each in everything.float_params}
    print("parameters", integers[integer] == integer_value, reals[real] == real_value)
    await here.attempt_async(plugin.set_param_int, integer, before)


async def setpoints(here: Circumstances, system: Any, telemetry: Any) -> None:
    await arm(here, ActionAsync(system), telemetry)
    plugin = OffboardAsync(system)
    await plugin.set_velocity_body(VelocityBodyYawspeed(0.5, 0.0, 0.0, 0.0))
    await asyncio.sleep(LEAD)
    await here.attempt_async(plugin.start)
    await first(telemetry.subscribe_velocity_ned(), "motion", lambda v: v.north_m_s > 0.4)
    print("moves")
    await here.attempt_async(plugin.stop)
    await first(telemetry.subscribe_velocity_ned(), "standstill", lambda v: abs(v.north_m_s) < 0.02)
    print("stands")


async def main() -> None:
    async with connected() as (here, system, telemetry, home):
        await geofence(here, system, home)
        await parameters(here, system)
        await setpoints(here, system, telemetry)


if __name__ == "__main__":
    asyncio.run(main())
