"""Modes, arming and the offboard-loss failsafe of a PX4 rover."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.body import Pose
from rover_sim.frames import Frame
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import PX4, Mode
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


def driving() -> Rig:
    """Driving at 1 m/s in OFFBOARD; it holds when the stream is lost."""
    rig = Px4Rig()
    rig.autopilot.parameters["COM_OBL_RC_ACT"] = 5
    rig.ready_to_drive()
    rig.run(3.0, velocity(1.0))
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.02)
    return rig


def test_a_stream_that_returns_brings_offboard_back_unasked() -> None:
    rig = driving()
    rig.run(3.0)
    assert rig.mode() == PX4_HOLD
    rig.run(2.0, velocity(1.0))
    assert rig.mode() == PX4_OFFBOARD
    assert rig.truth.forward_speed > 0.5
    assert rig.last(m.Heartbeat).system_status == 4


def test_but_not_after_somebody_had_another_wish() -> None:
    for how in ["asked for hold", "disarmed", "the operator's switch"]:
        rig = driving()
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
    assert (rig.truth.north, rig.truth.east) == pytest.approx((4.0, 2.0), abs=0.5)
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


# as it was recorded and tried


def test_zero_velocity_turns_a_differential_rover_to_north_or_south() -> None:
    for heading, zeros, course in [
        (90, velocity(0.0, 0.0), 0),
        (-180, velocity(0.0, 0.0), 0),
        (90, velocity(-0.0, 0.0), 180),  # 0.0 * cos of a heading beyond 90 degrees
        (-90, velocity(-0.0, -0.0), 180),
    ]:
        yaw = math.radians(heading)
        rig = Rig(PX4.on(Frame.DIFFERENTIAL), start=Pose(yaw=yaw))
        assert rig.arm() == MavResult.ACCEPTED
        rig.run(1.0, velocity(1e-3 * math.cos(yaw), 1e-3 * math.sin(yaw)))  # as it points
        assert rig.set_mode(PX4_OFFBOARD) == MavResult.ACCEPTED
        rig.run(4.0, zeros)
        assert abs(math.cos(rig.truth.yaw) - math.cos(math.radians(course))) < 1e-3
        assert math.hypot(rig.truth.north, rig.truth.east) < 0.001


def lost() -> Rig:
    """Return a rover that has been driven away from where it was armed; its setpoints end."""
    rig = Rig(PX4.on(Frame.DIFFERENTIAL))
    rig.ready_to_drive()
    rig.run(15.0, velocity(1.0))
    rig.take(m.Statustext)
    return rig


def test_by_default_lost_setpoints_are_a_drive_home_where_it_disarms_itself() -> None:
    rig = lost()
    rig.run(1.1)
    assert rig.mode() == PX4_RTL
    rig.run(5.0)
    assert rig.truth.forward_speed == pytest.approx(1.8, abs=0.05)
    rig.run(20.0)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((0.0, 0.0), abs=0.6)
    assert rig.texts() == [
        "Failsafe activated",
        "RTL: land at destination",
        "RTL: start return at 644 m (60 m above destination",
        ")",
        "Landing detected",
        "Disarmed by landing",
    ]
    assert (rig.mode(), rig.autopilot.armed) == (PX4_OFFBOARD, False)


def test_parameters_choose_what_a_lost_stream_is_answered_with() -> None:
    for row in """5 2: HOLD armed
        3 1: RTL armed
        4 2: LAND armed
        6 2: GUIDED
        7 2: GUIDED
        0 1: HOLD armed
        1 3: LAND armed
        2 6: GUIDED
        0 0: GUIDED armed""".splitlines():  # the last: no action, it drives on
        parameters, _, (mode, *armed) = map(str.split, row.partition(":"))
        rig = lost()
        for name, value in zip(("COM_OBL_RC_ACT", "NAV_RCL_ACT"), parameters, strict=True):
            rig.autopilot.parameters[name] = int(value)
        rig.run(1.3)
        assert (rig.autopilot.mode, rig.autopilot.armed) == (Mode[mode], bool(armed)), row
