"""DO_SET_HOME in both forms, of both makes."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import ARDUPILOT, PX4
from tests.unit.rover_sim.rig import Rig

X, Y = DEFAULT_ORIGIN.to_global(40.0, 20.0)
LATITUDE, LONGITUDE = X / 1e7, Y / 1e7


def test_home_is_where_it_is_put() -> None:
    for persona in [ARDUPILOT, PX4]:
        for form in ["COMMAND_INT", "COMMAND_LONG"]:
            rig = Rig(persona)
            rig.heard.clear()
            if form == "COMMAND_INT":
                rig.send(
                    m.CommandInt(1, 1, 0, MavCmd.DO_SET_HOME, 0, 0, 0, 0, 0, math.nan, X, Y, 0)
                )
            else:
                rig.command(MavCmd.DO_SET_HOME, 0, 0, 0, math.nan, LATITUDE, LONGITUDE, 584)
            assert rig.last(m.CommandAck).result == MavResult.ACCEPTED
            rig.run(0.1)
            if persona is PX4:  # ArduPilot tells it at once
                rig.command(MavCmd.GET_HOME_POSITION)
            home = rig.last(m.HomePosition)
            assert (home.latitude, home.longitude) == pytest.approx((X, Y), abs=100)
            assert (home.x, home.y) == pytest.approx((40.0, 20.0), abs=1.5)  # float32 degrees
