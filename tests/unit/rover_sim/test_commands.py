"""COMMAND_LONG and COMMAND_INT: one answer each, in ArduPilot's words."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.errors import SimulatedCrash
from rover_sim.geo import DEFAULT_ORIGIN
from tests.unit.rover_sim.rig import CLIENT, GUIDED, HOLD, Rig

SOMEWHERE = DEFAULT_ORIGIN.to_global(4.0, 2.0)


@pytest.mark.parametrize("command", [31000, 31010, 65000, MavCmd.DO_PAUSE_CONTINUE])
def test_unknown_commands_are_unsupported(command: int) -> None:
    assert Rig().command(command) == MavResult.UNSUPPORTED


def test_an_answer_is_addressed_to_the_sender() -> None:
    rig = Rig()
    rig.send_from(Address(77, 9), m.CommandLong(1, 1, 31000, 0, 0, 0, 0, 0, 0, 0, 0))
    ack = rig.last(m.CommandAck)
    assert (ack.target_system, ack.target_component) == (77, 9)


@pytest.mark.parametrize(("component", "answered"), [(0, True), (1, True), (50, True)])
def test_any_component_of_its_system_is_answered(component: int, answered: bool) -> None:
    rig = Rig()
    rig.send(m.CommandLong(1, component, 176, 0, 1, HOLD, 0, 0, 0, 0, 0))
    assert rig.last(m.CommandAck).result == MavResult.ACCEPTED


def test_another_systems_command_is_met_with_silence() -> None:
    rig = Rig()
    rig.heard.clear()
    rig.send(m.CommandLong(2, 1, 176, 0, 1, HOLD, 0, 0, 0, 0, 0))
    assert rig.heard == []


def test_a_repeat_is_carried_out_and_answered_again() -> None:
    rig = Rig()
    request = m.CommandLong(1, 1, MavCmd.REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)
    repeat = m.CommandLong(1, 1, MavCmd.REQUEST_MESSAGE, 1, 148, 0, 0, 0, 0, 0, 0)
    rig.heard.clear()
    rig.send(request, repeat)
    assert [type(x) for x in rig.heard] == [m.AutopilotVersion, m.CommandAck] * 2


def test_request_message_gives_the_message_or_fails() -> None:
    rig = Rig()
    assert rig.command(MavCmd.REQUEST_MESSAGE, m.AutopilotVersion.id) == MavResult.ACCEPTED
    version = rig.last(m.AutopilotVersion)
    assert (version.capabilities, version.uid) == (61935, 1)
    assert version.flight_sw_version >> 8 == 0x040603
    assert rig.command(MavCmd.REQUEST_MESSAGE, m.GpsGlobalOrigin.id) == MavResult.ACCEPTED
    assert rig.last(m.GpsGlobalOrigin).latitude == DEFAULT_ORIGIN.latitude_degE7
    for unknown in (300, 395, 397, 435, 60_000, math.nan):
        assert rig.command(MavCmd.REQUEST_MESSAGE, unknown) == MavResult.FAILED


def test_reposition_needs_command_int_in_a_global_frame() -> None:
    rig = Rig()
    x, y = SOMEWHERE
    assert rig.command(MavCmd.DO_REPOSITION, -1, 1) == MavResult.UNSUPPORTED
    int_max = 0x7FFFFFFF
    for frame, at in ((1, (x, y)), (6, (0, 0)), (6, (int_max, int_max))):
        result = rig.command_int(MavCmd.DO_REPOSITION, frame=frame, x=at[0], y=at[1], param2=1)
        assert result == MavResult.DENIED


@pytest.mark.parametrize("frame", [0, 5, 6])
def test_reposition_changes_to_guided_and_drives_there(frame: int) -> None:
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


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -1e30, 1e30])
def test_unusable_numbers_in_other_commands_are_refused_not_raised(value: float) -> None:
    rig = Rig()
    for command in (*MavCmd, 224):
        if command != MavCmd.DO_CHANGE_SPEED:
            rig.send(m.CommandLong(*CLIENT._replace(system_id=1), command, 0, *[value] * 7))
    assert not rig.autopilot.armed
