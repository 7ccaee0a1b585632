"""What a MAVSDK script does besides missions: a fence, parameters, setpoints of its own."""

import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.geofence.geofence import FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.offboard import Offboard
from mavsdk.plugins.offboard.offboard import VelocityBodyYawspeed
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

SIDE = 3 / 111_318.85  # degrees
PATIENCE = 30.0  # s


def wait_for(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(what)
        time.sleep(0.05)


def fence(system: Any, home: Any) -> None:
    plugin = Geofence(system)
    corners = [
        Point(home.latitude_deg + north * SIDE, home.longitude_deg + east * SIDE)
        for north, east in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    plugin.upload_geofence(GeofenceData([Polygon(corners, FenceType.INCLUSION)], []))
    print("fence uploaded")
    plugin.clear_geofence()
    print("fence cleared")


def parameters(system: Any) -> None:
    plugin = Param(system)
    plugin.set_param_float("WP_SPEED", 3.0)
    plugin.set_param_int("FS_GCS_ENABLE", 1)
    print("set", plugin.get_param_float("WP_SPEED"), plugin.get_param_int("FS_GCS_ENABLE"))
    everything = plugin.get_all_params()
    print("all", len(everything.int_params) > 20, len(everything.float_params) > 5)
    plugin.set_param_int("FS_GCS_ENABLE", 0)


def setpoints(system: Any, telemetry: Any) -> None:
    Action(system).arm()
    plugin = Offboard(system)
    plugin.set_velocity_body(VelocityBodyYawspeed(0.5, 0.0, 0.0, 0.0))
    plugin.start()
    wait_for(lambda: telemetry.velocity_ned().north_m_s > 0.4, "motion")
    print("moves")
    plugin.stop()
    wait_for(lambda: abs(telemetry.velocity_ned().north_m_s) < 0.02, "standstill")
    print("stands")


def main(url: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    with Mavsdk(configuration) as mavsdk:
        mavsdk.add_any_connection(url)
        system = mavsdk.first_autopilot(10.0)
        telemetry = Telemetry(system)
        wait_for(telemetry.health_all_ok, "health")
        homes: list[Any] = []
        telemetry.subscribe_home(lambda home, _: homes.append(home))
        wait_for(lambda: homes, "home")
        fence(system, homes[0])
        parameters(system)
        setpoints(system, telemetry)
    print("done")


if __name__ == "__main__":
    main(sys.argv[1])
