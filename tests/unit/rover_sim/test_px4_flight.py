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
    PX4_OFFBOARD,
    PX4_RTL,
    Px4Rig,
    Rig,
    velocity,
)

REJECTED = MavResult.TEMPORARILY_REJECTED


def go_to(rig: Rig, north: float, east: float) -> MavResult:
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return rig.command_int(MavCmd.DO_REPOSITION, frame=0, x=x, y=y, param2=1)


def pause(rig: Rig) -> MavResult:
    """As QGroundControl's Pause."""
    return rig.command(MavCmd.DO_REPOSITION, -1, 1, 0, *[math.nan] * 4)


def distance_from(rig: Rig, north: float, east: float) -> float:
    return math.dist((north, east), (rig.truth.north, rig.truth.east))


def test_offboard_needs_a_stream() -> None:
    for rate, seconds, result in [
        (20.0, 0.3, MavResult.ACCEPTED),
        (2.0, 2.2, MavResult.ACCEPTED),
        (1.0, 3.2, REJECTED),  # below 2 Hz
        (20.0, 0.04, REJECTED),  # a single one is no stream
    ]:
        rig = Px4Rig()
        rig.arm()
        rig.run(seconds, velocity(0.0), rate=rate)
        assert rig.set_mode(PX4_OFFBOARD) == result


def driving(action: int, *, timeout: float = 1.0) -> Rig:
    """Driving at 1 m/s in OFFBOARD, with that action for a lost stream."""
    rig = Px4Rig()
    rig.autopilot.parameters["COM_OBL_RC_ACT"] = action
    rig.autopilot.parameters["COM_OF_LOSS_T"] = timeout
    rig.ready_to_drive()
    rig.run(3.0, velocity(1.0))
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.02)
    return rig


def test_a_stream_that_returns_brings_offboard_back_unasked() -> None:
    rig = driving(5)
    rig.run(3.0)
    assert rig.mode() == PX4_HOLD
    rig.run(2.0, velocity(1.0))
    assert rig.mode() == PX4_OFFBOARD
    assert rig.truth.forward_speed > 0.5
    assert rig.last(m.Heartbeat).system_status == 4


def test_but_not_after_somebody_had_another_wish() -> None:
    for how in ["asked for hold", "disarmed", "the operator's switch"]:
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
