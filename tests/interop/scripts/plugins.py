"""What a MAVSDK script does besides missions: a fence, parameters, setpoints of its own."""

import time
from typing import Any

from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.offboard import Offboard
from mavsdk.plugins.offboard.offboard import VelocityBodyYawspeed
from mavsdk.plugins.param import Param

from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.common import arm, connected, wait_for
from tests.interop.scripts.facts import LEAD
from tests.interop.scripts.plans import fence


def geofence(here: Circumstances, system: Any, home: Any) -> None:
    plugin = Geofence(system)
    here.attempt(plugin.upload_geofence, fence(home))
    back = here.attempt(plugin.download_geofence)
    print("fence", [len(polygon.points) for polygon in back.polygons])
    here.attempt(plugin.clear_geofence)
    print("fences", len(here.attempt(plugin.download_geofence).polygons))


def parameters(here: Circumstances, system: Any) -> None:
    plugin = Param(system)
    (real, real_value), (integer, integer_value) = here.persona.real, here.persona.integer
    before = here.attempt(plugin.get_param_int, integer)
    here.attempt(plugin.set_param_float, real, real_value)
    here.attempt(plugin.set_param_int, integer, integer_value)
    assert here.attempt(plugin.get_param_float, real) == real_value
    assert here.attempt(plugin.get_param_int, integer) == integer_value
    everything = here.attempt(plugin.get_all_params)
    integers = {each.name: each.value for each in everything.int_params}
    reals = {each.name: each.value for each in everything.float_params}
    print("parameters", integers[integer] == integer_value, reals[real] == real_value)
    here.attempt(plugin.set_param_int, integer, before)


def setpoints(here: Circumstances, system: Any, telemetry: Any) -> None:
    arm(here, Action(system), telemetry)
    plugin = Offboard(system)
    plugin.set_velocity_body(VelocityBodyYawspeed(0.5, 0.0, 0.0, 0.0))
    time.sleep(LEAD)
    here.attempt(plugin.start)
    wait_for(lambda: telemetry.velocity_ned().north_m_s > 0.4, "motion")
    print("moves")
    here.attempt(plugin.stop)
    wait_for(lambda: abs(telemetry.velocity_ned().north_m_s) < 0.02, "standstill")
    print("stands")


def main() -> None:
    with connected() as (here, system, telemetry, home):
        geofence(here, system, home)
        parameters(here, system)
        setpoints(here, system, telemetry)


if __name__ == "__main__":
    main()
