"""What a script of MAVSDK's older API does: ``mavsdk_grpc``, over a ``mavsdk_server`` that runs.

Its address is that server's ``host:port``. It knows nothing of a task server.
"""

import asyncio
from typing import Any

from mavsdk_grpc import System
from mavsdk_grpc.action import ActionError
from mavsdk_grpc.mission import MissionError, MissionItem, MissionPlan
from mavsdk_grpc.telemetry import TelemetryError

from tests.interop.scripts.asyncio_waiting import Watch, first, wait_for, wait_for_motion
from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.facts import METRES, NAN
from tests.interop.scripts.progress import is_told_to_the_end, pairs


def item(home: Any, north: float) -> MissionItem:
    return MissionItem(
        latitude_deg=home.latitude_deg + north / METRES,
        longitude_deg=home.longitude_deg,
        relative_altitude_m=0.0,
        speed_m_s=1.0,
        is_fly_through=True,
        gimbal_pitch_deg=NAN,
        gimbal_yaw_deg=NAN,
        camera_action=MissionItem.CameraAction.NONE,
        loiter_time_s=NAN,
        camera_photo_interval_s=NAN,
        acceptance_radius_m=0.3,
        yaw_deg=NAN,
        camera_photo_distance_m=NAN,
        vehicle_action=MissionItem.VehicleAction.NONE,
    )


async def streams(rover: System) -> None:
    """What has only to come; what it is worth is looked at with the newer API."""
    names = ("position", "velocity_ned", "attitude_euler", "battery", "flight_mode", "in_air")
    for name in names:
        await first(getattr(rover.telemetry, name)(), name)
    print("heard", *names)


async def mission(here: Circumstances, rover: System, home: Any) -> None:
    plan = MissionPlan([item(home, north) for north in (1.0, 2.5)])
    await here.attempt_async(rover.mission.upload_mission, plan)
    back = await here.attempt_async(rover.mission.download_mission)
    print("downloaded", len(back.mission_items))
    async with Watch(rover.mission.mission_progress()) as progress:
        await here.attempt_async(rover.mission.start_mission)
        await wait_for(rover.mission.is_mission_finished, "the end")
        await progress.until(is_told_to_the_end, "the last item")
        print("progress", pairs(progress.seen))
    await here.attempt_async(rover.mission.clear_mission)


async def place(here: Circumstances, rover: System, home: Any) -> None:
    north = home.latitude_deg + 4 / METRES
    goto = rover.action.goto_location
    async with Watch(rover.telemetry.status_text()) as texts:
        await here.attempt_async(goto, north, home.longitude_deg, 0.0, NAN)
        await wait_for_motion(rover.telemetry.velocity_ned(), moves=True)
        await first(
            rover.telemetry.position(), "arrival", lambda at: abs(at.latitude_deg - north) < 1e-6
        )
        await wait_for_motion(rover.telemetry.velocity_ned(), moves=False)
        if not here.is_lossy:  # a text comes once
            await texts.until(lambda seen: any("Task" in t.text for t in seen), "a task's text")
        print("arrived", any("Task" in each.text for each in texts.seen))


async def main() -> None:
    here = Circumstances.from_arguments(ActionError, MissionError, TelemetryError)
    host, port = here.address.rsplit(":", 1)
    rover = System(mavsdk_server_address=host, port=int(port))
    await rover.connect()
    await first(rover.core.connection_state(), "a rover", lambda state: state.is_connected)
    await first(rover.telemetry.health_all_ok(), "health", bool)
    home = await first(rover.telemetry.home(), "home")
    await streams(rover)
    await here.attempt_async(rover.action.hold)
    await first(rover.telemetry.flight_mode(), "HOLD", lambda mode: mode.name == "HOLD")
    await here.attempt_async(rover.action.arm)
    await mission(here, rover, home)
    await place(here, rover, home)
    print("done")


if __name__ == "__main__":
    asyncio.run(main())
