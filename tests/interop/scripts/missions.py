"""What a MAVSDK script does with missions, without knowing of a task server. Prints what it saw."""

import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw.mission_raw import MissionItem as RawItem
from mavsdk.plugins.telemetry import Telemetry

NAN = float("nan")
METRES = 111_318.85  # a degree of latitude
PATIENCE = 40.0  # s


def wait_for(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(what)
        time.sleep(0.05)


def wait_for_motion(telemetry: Any, *, moves: bool) -> None:
    def speed() -> float:
        velocity = telemetry.velocity_ned()
        return float(abs(velocity.north_m_s) + abs(velocity.east_m_s))

    wait_for(lambda: (speed() > 0.2) is moves, "motion" if moves else "standstill")


def raw_mission(system: Any, telemetry: Any, home: Any) -> None:
    raw = MissionRaw(system)
    latitude, longitude = round(home.latitude_deg * 1e7), round(home.longitude_deg * 1e7)
    items = [
        RawItem(n, 6, 16, int(n == 0), 1, 0, 0, 0, NAN, latitude + round(n * 90), longitude, 0.0, 0)
        for n in range(4)
    ]
    raw.upload_mission(items)
    back = raw.download_mission()
    print("raw downloaded", [(item.command, item.x - latitude) for item in back[1:]])
    seen: list[tuple[int, int]] = []
    raw.subscribe_mission_progress(lambda p, _: seen.append((p.current, p.total)))
    raw.start_mission()
    wait_for(lambda: seen and seen[-1][0] >= 2, "an item")
    raw.pause_mission()
    wait_for_motion(telemetry, moves=False)
    raw.set_current_mission_item(3)
    raw.start_mission()
    wait_for(raw.is_mission_finished, "the end of the raw mission")
    print("raw progress", seen[-1])
    raw.clear_mission()


def mission(system: Any, home: Any) -> None:
    plugin = Mission(system)
    items = [
        MissionItem(
            home.latitude_deg + north / METRES,
            home.longitude_deg,
            relative_altitude_m=0.0,
            speed_m_s=1.0,
            is_fly_through=True,
            camera_action=0,
            vehicle_action=0,
        )
        for north in (2, 1, 0.5)
    ]
    seen: list[tuple[int, int]] = []
    plugin.subscribe_mission_progress(lambda p, _: seen.append((p.current, p.total)))
    plugin.upload_mission(MissionPlan(items))
    print("downloaded", len(plugin.download_mission().mission_items))
    plugin.start_mission()
    wait_for(plugin.is_mission_finished, "the end of the mission")
    print("progress", seen)
    plugin.clear_mission()


def main(url: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    with Mavsdk(configuration) as mavsdk:
        mavsdk.add_any_connection(url)
        system = mavsdk.first_autopilot(10.0)
        telemetry, action = Telemetry(system), Action(system)
        wait_for(telemetry.health_all_ok, "health")
        homes: list[Any] = []
        telemetry.subscribe_home(lambda home, _: homes.append(home))
        wait_for(lambda: homes, "home")
        action.arm()
        raw_mission(system, telemetry, homes[0])
        mission(system, homes[0])
        action.goto_location(homes[0].latitude_deg + 1 / METRES, homes[0].longitude_deg, 0.0, NAN)
        wait_for_motion(telemetry, moves=True)
        action.hold()
        wait_for_motion(telemetry, moves=False)
        action.return_to_launch()
        wait_for_motion(telemetry, moves=True)
    print("done")


if __name__ == "__main__":
    main(sys.argv[1])
