"""What scripts do with a simulated rover, no server between.

``python -m tests.interop.scripts.simulated NAME PORT`` runs one against a rover on that UDP port;
it ends with status 0 if all went as it should.
"""

import sys
import time
from collections.abc import Callable
from math import isnan, nan
from typing import Any

from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.geofence.geofence import Circle, FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw.mission_raw import MissionItem
from mavsdk.plugins.offboard import Offboard
from mavsdk.plugins.offboard.offboard import VelocityBodyYawspeed, VelocityNedYaw
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

from tests.interop.scripts.common import system_at, wait_for

LIMIT = 10.0  # s for anything that is waited for
HOLD, MISSION, RETURN, OFFBOARD = 3, 4, 5, 7  # MAVSDK's FlightMode
LATITUDE, LONGITUDE = -35.363262, 149.165237


def wait_until(condition: Callable[[], object]) -> None:
    wait_for(condition, "what was expected", within=LIMIT)


def telemetry(system: Any) -> None:
    """Health, position, home and mode come unasked."""
    telemetry = Telemetry(system)
    wait_until(telemetry.health_all_ok)
    assert telemetry.health().is_armable
    wait_until(lambda: not isnan(telemetry.position().latitude_deg))
    position, home = telemetry.position(), telemetry.home()
    for place in (position, home):
        assert abs(place.latitude_deg - LATITUDE) < 1e-6
        assert abs(place.longitude_deg - LONGITUDE) < 1e-6
    assert telemetry.flight_mode() == HOLD
    assert not telemetry.armed()
    wait_until(lambda: telemetry.battery().remaining_percent == 100.0)


def parameters(system: Any) -> None:
    """Integers and floats are read, set and listed."""
    param = Param(system)
    assert param.get_param_int("COM_OBL_RC_ACT") == 0
    param.set_param_int("COM_OBL_RC_ACT", 5)
    assert param.get_param_int("COM_OBL_RC_ACT") == 5
    assert param.get_param_int("CAL_ACC0_ID") == 1310988
    param.set_param_int("COM_FLTMODE1", -7)
    assert param.get_param_int("COM_FLTMODE1") == -7
    param.set_param_float("COM_OF_LOSS_T", 1.5)
    assert param.get_param_float("COM_OF_LOSS_T") == 1.5
    everything = param.get_all_params()
    integers = {each.name: each.value for each in everything.int_params}
    floats = {each.name: each.value for each in everything.float_params}
    assert (integers["COM_OBL_RC_ACT"], integers["SYS_AUTOSTART"]) == (5, 50000)
    assert floats["COM_OF_LOSS_T"] == 1.5


def plans(system: Any) -> None:
    """A mission of 20 items and a fence go there, come back and are cleared."""
    missions, fence = MissionRaw(system), Geofence(system)
    items = [mission_item(seq) for seq in range(20)]
    missions.upload_mission(items)
    back = missions.download_mission()
    assert [(item.seq, item.command, item.x, item.y) for item in back] == [
        (item.seq, item.command, item.x, item.y) for item in items
    ]
    missions.set_current_mission_item(3)
    missions.clear_mission()
    assert missions.download_mission() == []

    corners = [Point(-35.3, 149.1), Point(-35.3, 149.2), Point(-35.4, 149.2)]
    circle = Circle(Point(LATITUDE, LONGITUDE), 20.0, FenceType.EXCLUSION)
    fence.upload_geofence(GeofenceData([Polygon(corners, FenceType.INCLUSION)], [circle]))
    there = fence.download_geofence()
    assert [len(polygon.points) for polygon in there.polygons] == [3]
    assert [each.radius for each in there.circles] == [20.0]
    fence.clear_geofence()


def mission_item(seq: int) -> MissionItem:
    return MissionItem(
        seq=seq,
        frame=6,
        command=16,
        current=1 if seq == 0 else 0,
        autocontinue=1,
        param1=0.0,
        param2=1.0,
        param3=0.0,
        param4=nan,
        x=-353632620 + 300 * seq,
        y=1491652370,
        z=0.0,
        mission_type=0,
    )


def modes(system: Any) -> None:
    """Arm, hold, a mission begun and paused, a place driven to, the way home."""
    telemetry, action, missions = Telemetry(system), Action(system), MissionRaw(system)
    wait_until(telemetry.health_all_ok)
    action.hold()
    action.arm()
    wait_until(telemetry.armed)
    missions.upload_mission([mission_item(seq) for seq in range(2)])
    missions.start_mission()
    wait_until(lambda: telemetry.flight_mode() == MISSION)
    missions.pause_mission()
    wait_until(lambda: telemetry.flight_mode() == HOLD)
    start = telemetry.position()
    action.goto_location(start.latitude_deg + 2e-5, start.longitude_deg, 584.0, nan)
    wait_until(lambda: telemetry.position().latitude_deg - start.latitude_deg > 1e-5)
    action.return_to_launch()
    wait_until(lambda: telemetry.flight_mode() == RETURN)
    action.disarm()
    wait_until(lambda: not telemetry.armed())


def offboard(system: Any) -> None:
    """Velocities drive it, north and ahead; stopping holds it."""
    telemetry, action, offboard = Telemetry(system), Action(system), Offboard(system)
    wait_until(telemetry.health_all_ok)
    action.arm()
    wait_until(telemetry.armed)
    offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 0.0))
    time.sleep(0.5)  # the stream is to be there first
    offboard.start()
    offboard.set_velocity_ned(VelocityNedYaw(1.0, 0.0, 0.0, 0.0))
    wait_until(lambda: telemetry.flight_mode() == OFFBOARD)
    wait_until(lambda: telemetry.position_velocity_ned().position.north_m > 0.5)
    offboard.set_velocity_body(VelocityBodyYawspeed(0.5, 0.0, 0.0, 30.0))
    wait_until(lambda: telemetry.position_velocity_ned().position.north_m > 1.0)
    assert abs(telemetry.position_velocity_ned().position.east_m) < 0.1  # yaw rate passed over
    offboard.stop()
    wait_until(lambda: telemetry.flight_mode() == HOLD)
    wait_until(lambda: abs(telemetry.position_velocity_ned().velocity.north_m_s) < 0.01)


SCRIPTS: dict[str, Callable[[Any], None]] = {
    script.__name__: script for script in (telemetry, parameters, plans, modes, offboard)
}


def main(name: str, port: str) -> None:
    with system_at(f"udpout://127.0.0.1:{port}", within=LIMIT) as system:
        SCRIPTS[name](system)


if __name__ == "__main__":
    main(*sys.argv[1:])
