"""Modes, arming and the offboard-loss failsafe of a PX4 rover."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.body import Pose
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import Mode
from tests.unit.rover_sim.rig import (
    PX4_HOLD,
    PX4_MANUAL,
    PX4_OFFBOARD,
    PX4_POSCTL,
    PX4_RTL,
    Px4Rig,
    velocity,
)

REJECTED = MavResult.TEMPORARILY_REJECTED
NOT_GIVEN = 0x7FFFFFFF  # x and y of COMMAND_INT


def go_to(rig: Px4Rig, north: float, east: float) -> MavResult:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return rig.command_int(MavCmd.DO_REPOSITION, frame=0, x=x, y=y, param2=1)


def pause(rig: Px4Rig) -> MavResult:
    """As QGroundControl's Pause."""
    return rig.command(MavCmd.DO_REPOSITION, -1, 1, 0, *[math.nan] * 4)


def distance_from(rig: Px4Rig, north: float, east: float) -> float:
    return math.dist((north, east), (rig.truth.north, rig.truth.east))


def test_it_comes_up_in_hold() -> None:
    rig = Px4Rig(wait=0.1)
    (first,) = rig.take(m.Heartbeat)
    assert (first.custom_mode, first.system_status) == (PX4_HOLD, 3)


@pytest.mark.parametrize("mode", [PX4_MANUAL, PX4_POSCTL, PX4_HOLD, PX4_RTL])
def test_modes_that_need_nothing_are_entered_and_shown_with_the_next_beat(mode: int) -> None:
    rig = Px4Rig(wait=1.5)
    rig.heard.clear()
    assert rig.set_mode(mode) == MavResult.ACCEPTED
    assert rig.take(m.Heartbeat) == []
    rig.run(1.0)
    assert [beat.custom_mode for beat in rig.take(m.Heartbeat)] == [mode]


def test_a_refused_mode_comes_with_a_text() -> None:
    rig = Px4Rig()
    rig.arm()
    rig.set_mode(PX4_OFFBOARD)
    assert rig.texts()[-1:] == ["Switching to Offboard is currently not available"]


@pytest.mark.parametrize(
    ("rate", "seconds", "result"),
    [
        (20.0, 0.3, MavResult.ACCEPTED),
        (2.0, 2.2, MavResult.ACCEPTED),
        (1.0, 3.2, REJECTED),  # below 2 Hz
        (20.0, 0.04, REJECTED),  # a single one is no stream
    ],
)
def test_offboard_needs_a_stream(rate: float, seconds: float, result: MavResult) -> None:
    rig = Px4Rig()
    rig.arm()
    rig.run(seconds, velocity(0.0), rate=rate)
    assert rig.set_mode(PX4_OFFBOARD) == result


def test_a_stream_of_half_a_second_ago_is_none() -> None:
    rig = Px4Rig()
    rig.arm()
    rig.run(1.0, velocity(0.0))
    rig.run(0.55)
    assert rig.set_mode(PX4_OFFBOARD) == REJECTED


def test_setpoints_before_offboard_are_not_kept() -> None:
    rig = Px4Rig()
    rig.arm()
    rig.run(1.0, velocity(1.0))
    rig.set_mode(PX4_OFFBOARD)
    rig.run(0.9)
    assert rig.truth.forward_speed == 0.0


def test_arming_too_early_is_refused_forced_or_not() -> None:
    rig = Px4Rig(wait=0.3)
    for magic in (0, 21196):
        assert rig.command(MavCmd.COMPONENT_ARM_DISARM, 1, magic) == REJECTED
    assert set(rig.texts()) == {"Arming denied: health checks not passed yet"}
    rig.run(1.0)
    assert rig.arm() == MavResult.ACCEPTED


def test_arming_in_offboard_without_setpoints_is_refused() -> None:
    rig = Px4Rig()
    rig.run(1.0, velocity(0.0))
    assert rig.set_mode(PX4_OFFBOARD) == MavResult.ACCEPTED
    rig.run(0.6)
    assert rig.arm() == REJECTED
    assert rig.texts()[-1] == "Arming denied: Offboard cannot run"
    rig.run(1.0, velocity(0.0))
    assert rig.arm() == MavResult.ACCEPTED


def test_armed_it_is_active_and_not_landed() -> None:
    rig = Px4Rig()
    rig.arm()
    rig.run(1.1)
    beat = rig.last(m.Heartbeat)
    assert (beat.base_mode & 128, beat.system_status) == (128, 4)
    assert rig.last(m.ExtendedSysState).landed_state == 2
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    rig.run(1.1)
    assert rig.last(m.Heartbeat).system_status == 3
    assert rig.last(m.ExtendedSysState).landed_state == 1


def driving(action: int, *, timeout: float = 1.0) -> Px4Rig:
    """Driving at 1 m/s in OFFBOARD, with that action for a lost stream."""
    rig = Px4Rig()
    rig.autopilot.parameters["COM_OBL_RC_ACT"] = action
    rig.autopilot.parameters["COM_OF_LOSS_T"] = timeout
    rig.ready_to_drive()
    rig.run(3.0, velocity(1.0))
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.02)
    return rig


def test_until_then_it_drives_on_and_then_it_stops() -> None:
    rig = driving(5, timeout=2.0)
    began = rig.truth.north
    rig.run(1.9)
    assert rig.truth.north - began == pytest.approx(1.9, abs=0.05)
    rig.run(3.0)
    assert rig.truth.forward_speed == 0.0
    assert rig.last(m.Heartbeat).system_status == 5


def test_a_stream_that_returns_brings_offboard_back_unasked() -> None:
    rig = driving(5)
    rig.run(3.0)
    assert rig.mode() == PX4_HOLD
    rig.run(2.0, velocity(1.0))
    assert rig.mode() == PX4_OFFBOARD
    assert rig.truth.forward_speed > 0.5
    assert rig.last(m.Heartbeat).system_status == 4


@pytest.mark.parametrize("how", ["asked for hold", "disarmed", "the operator's switch"])
def test_but_not_after_somebody_had_another_wish(how: str) -> None:
    rig = driving(5)
    rig.run(3.0)
    match how:
        case "asked for hold":
            rig.set_mode(PX4_HOLD)
        case "disarmed":
            rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
            assert rig.arm() == MavResult.ACCEPTED
        case _:
            rig.autopilot.operator_mode(Mode.HOLD, now=rig.now)
    rig.run(2.0, velocity(1.0))
    assert (rig.mode(), rig.truth.forward_speed) == (PX4_HOLD, 0.0)


def test_a_lost_stream_matters_only_armed_in_offboard() -> None:
    rig = Px4Rig()
    rig.run(1.0, velocity(0.0))
    rig.set_mode(PX4_OFFBOARD)
    rig.run(3.0)
    assert rig.mode() == PX4_OFFBOARD


def test_reposition_drives_there_in_hold_from_any_mode() -> None:
    rig = Px4Rig()
    rig.ready_to_drive()
    assert go_to(rig, 4.0, 2.0) == MavResult.ACCEPTED
    assert rig.mode() == PX4_HOLD
    rig.run(1.0)
    x, y = DEFAULT_ORIGIN.to_global(4.0, 2.0)
    shown = rig.last(m.PositionTargetGlobalInt)
    assert (shown.lat_int, shown.lon_int) == pytest.approx((x, y), abs=1)
    rig.run(12.0)
    assert distance_from(rig, 4.0, 2.0) < 0.5
    assert rig.truth.forward_speed == 0.0
    assert rig.take(m.MissionItemReached) == []


def test_hold_asked_for_again_does_not_stop_it_but_a_pause_does() -> None:
    rig = Px4Rig()
    rig.arm()
    go_to(rig, 30.0, 0.0)
    rig.run(3.0)
    assert rig.set_mode(PX4_HOLD) == MavResult.ACCEPTED
    rig.run(1.0)
    assert rig.truth.forward_speed > 1.0
    assert pause(rig) == MavResult.ACCEPTED
    rig.run(6.0)
    assert rig.truth.forward_speed == 0.0


@pytest.mark.parametrize("given", [(0.0, math.nan), (math.nan, 0.0), (0.0, 0.0)])
@pytest.mark.parametrize("is_int", [True, False])
def test_a_pause_with_a_heading_or_an_altitude_is_none(
    given: tuple[float, float], *, is_int: bool
) -> None:
    """It drives on to its place: so does PX4 1.17, which stays for nothing but NaN."""
    rig = Px4Rig()
    rig.arm()
    go_to(rig, 30.0, 0.0)
    rig.run(3.0)
    heading, altitude = given
    if is_int:
        rig.command_int(
            MavCmd.DO_REPOSITION,
            frame=0,
            x=NOT_GIVEN,
            y=NOT_GIVEN,
            param2=1,
            param4=heading,
            z=altitude,
        )
    else:
        rig.command(MavCmd.DO_REPOSITION, -1, 1, 0, heading, math.nan, math.nan, altitude)
    rig.run(3.0)
    assert rig.truth.forward_speed > 1.0


def test_a_pause_without_the_mode_change_is_unsupported_and_obeyed_in_hold() -> None:
    """The commander knows no such command, the navigator does."""
    rig = Px4Rig()
    rig.arm()
    go_to(rig, 30.0, 0.0)
    rig.run(3.0)
    result = rig.command(MavCmd.DO_REPOSITION, -1, 0, 0, *[math.nan] * 4)
    assert result == MavResult.UNSUPPORTED
    rig.run(6.0)
    assert rig.truth.forward_speed == 0.0


def test_change_speed_holds_while_it_drives_by_itself() -> None:
    rig = Px4Rig()
    rig.arm()
    go_to(rig, 30.0, 0.0)
    assert rig.command(MavCmd.DO_CHANGE_SPEED, 1, 0.8, -1) == MavResult.ACCEPTED
    rig.run(3.0)
    assert rig.truth.forward_speed == pytest.approx(0.8, abs=0.02)


def test_rtl_drives_to_where_it_was_armed() -> None:
    rig = Px4Rig(start=Pose(north=5.0, east=-3.0))
    rig.ready_to_drive()
    rig.run(6.0, velocity(1.0, 1.0))
    rig.set_mode(PX4_HOLD)
    rig.run(3.0)
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    there = rig.truth
    rig.ready_to_drive()
    rig.run(6.0, velocity(1.0, 0.0))
    rig.set_mode(PX4_RTL)
    rig.run(20.0)
    assert distance_from(rig, there.north, there.east) < 0.5
    home = rig.last(m.HomePosition)
    assert (home.x, home.y) == pytest.approx((there.north, there.east), abs=0.01)


@pytest.mark.parametrize("mode", [Mode.MANUAL, Mode.POSITION])
def test_the_operator_drives_by_hand(mode: Mode) -> None:
    rig = Px4Rig()
    rig.ready_to_drive()
    rig.autopilot.operator_mode(mode, now=rig.now)
    rig.autopilot.operator_sticks(-0.5, 0.2)
    rig.run(2.0, velocity(1.0))
    assert rig.truth.forward_speed == pytest.approx(-0.5, abs=0.01)


def test_a_reboot_ends_in_hold() -> None:
    rig = Px4Rig()
    rig.arm()
    assert rig.command(MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, 1) == MavResult.DENIED
    rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
    rig.set_mode(PX4_MANUAL)
    rig.command(MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, 1)
    rig.run(3.0)
    assert rig.mode() == PX4_HOLD
