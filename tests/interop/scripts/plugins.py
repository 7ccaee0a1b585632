"""What a MAVSDK script does besides missions: a fence, parameters, setpoints of its own."""

import time
from contextlib import suppress
from typing import Any

from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.offboard import Offboard
from mavsdk.plugins.offboard.offboard import VelocityBodyYawspeed
from mavsdk.plugins.param import Param, ParamError
from mavsdk.plugins.param.param import ProtocolVersion

from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.common import arm, connected, wait_for
from tests.interop.scripts.facts import LEAD
from tests.interop.scripts.plans import fence

SERVER = 191  # its component


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


def parameters_of_the_server(here: Circumstances, system: Any) -> None:
    plugin = Param(system)
    with suppress(ParamError):  # MAVSDK 4.1 says UNKNOWN, and has done it
        plugin.select_component(SERVER, ProtocolVersion.V1)
    here.attempt(plugin.set_param_float, "TSK_SPEED", 0.75)
    print("TSK_SPEED", here.attempt(plugin.get_param_float, "TSK_SPEED"))
    print("of the server", len(here.attempt(plugin.get_all_params).float_params))
    if not here.is_lossy:  # an error that may be tried again comes eight times
        for name, value in (("TSK_SPEED", 50.0), ("TSK_NONE", 1.0)):
            try:
                plugin.set_param_float(name, value)
            except ParamError as error:
                print(name, error.result.name)


def setpoints(here: Circumstances, system: Any, telemetry: Any) -> None:
    arm(here, Action(system), telemetry)
    plugin = Offboard(system)
    plugin.set_velocity_body(VelocityBodyYawspeed(0.5, 0.0, 0.0, 0.0))
    time.sleep(LEAD)
    here.attempt(plugin.start)
    wait_for(lambda: telemetry.velocity_ned().north_m_s > 0.4, "motion")
    print("moves")
    here.attempt(plugin.stop)
    wait_for(lambda: abs(telemetry.velocity_ned().north_m_s) < 0.05, "standstill")  # noise
    print("stands")


def main() -> None:
    with connected() as (here, system, telemetry, home):
        geofence(here, system, home)
        parameters(here, system)
        parameters_of_the_server(here, system)
        setpoints(here, system, telemetry)


if __name__ == "__main__":
    main()
