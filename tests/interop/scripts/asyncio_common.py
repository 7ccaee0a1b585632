"""What the scripts of MAVSDK 4's asyncio face begin with."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, MavsdkError
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

from tests.interop.scripts.asyncio_waiting import Watch, first
from tests.interop.scripts.circumstances import PATIENCE, Circumstances
from tests.interop.scripts.facts import HOLD


@asynccontextmanager
async def connected() -> AsyncIterator[tuple[Circumstances, Any, Any, Any]]:
    """Return the circumstances, the system, its telemetry and its home, once it is healthy."""
    circumstances = Circumstances.from_arguments(MavsdkError)
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(circumstances.address)
        system = await mavsdk.first_autopilot(PATIENCE)
        assert system is not None, "no autopilot"
        telemetry = TelemetryAsync(system)
        async with Watch(telemetry.subscribe_home()) as homes:
            await first(telemetry.subscribe_health_all_ok(), "health", bool)
            await homes.until(bool, "home")
        yield circumstances, system, telemetry, homes.seen[0]
    print("done")


async def arm(here: Circumstances, action: Any, telemetry: Any) -> None:
    """Arm it in HOLD: a rover that somebody else has armed is taken over from no other mode."""
    await here.attempt_async(action.hold)
    await first(telemetry.subscribe_flight_mode(), "HOLD", lambda mode: mode == HOLD)
    await here.attempt_async(action.arm)
