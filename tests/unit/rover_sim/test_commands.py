"""COMMAND_LONG and COMMAND_INT: one answer each, in ArduPilot's words."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.errors import SimulatedCrash
from rover_sim.geo import DEFAULT_ORIGIN
from tests.unit.rover_sim.rig import GUIDED, Rig

SOMEWHERE = DEFAULT_ORIGIN.to_global(4.0, 2.0)


def test_a_repeat_is_carried_out_and_answered_again() -> None:
    rig = Rig()
    request = m.CommandLong(1, 1, MavCmd.REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)
    repeat = m.CommandLong(1, 1, MavCmd.REQUEST_MESSAGE, 1, 148, 0, 0, 0, 0, 0, 0)
    rig.heard.clear()
    rig.send(request, repeat)
    assert [type(x) for x in rig.heard] == [m.AutopilotVersion, m.CommandAck] * 2


def test_reposition_changes_to_guided_and_drives_there() -> None:
    for frame in [0, 5, 6]:
        rig = Rig()
        rig.arm()
        x, y = SOMEWHERE
        result = rig.command_int(MavCmd.DO_REPOSITION, frame=frame, x=x, y=y, param2=1)
        assert result == MavResult.ACCEPTED
        assert rig.last(m.Heartbeat).custom_mode == GUIDED
        rig.run(12.0)
        assert (rig.truth.north, rig.truth.east) == pytest.approx((4.0, 2.0), abs=0.15)
        assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [0]


def test_nan_speed_crashes_as_the_real_one() -> None:
    rig = Rig()
    with pytest.raises(SimulatedCrash):
        rig.command(MavCmd.DO_CHANGE_SPEED, 1, math.nan)
