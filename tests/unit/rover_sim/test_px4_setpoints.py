"""Which setpoints move a PX4 rover, which only keep OFFBOARD alive, and which do neither."""

import math
from dataclasses import replace

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.messages import Message
from rover_sim.body import Pose
from rover_sim.personas import PX4
from tests.unit.rover_sim.rig import (
    BODY_NED,
    LOCAL_NED,
    LOCAL_OFFSET_NED,
    POSITION,
    PX4_OFFBOARD,
    VELOCITY,
    VELOCITY_AND_RATE,
    Px4Rig,
    Rig,
    body_velocity,
    local_target,
    velocity,
)

LOCAL = "SET_POSITION_TARGET_LOCAL_NED"
NAN = math.nan
ACCELERATION = 0x0C3F


def driven(stream: Message, *, seconds: float = 4.0, yaw: float = 0.0) -> Rig:
    rig = Px4Rig(start=Pose(yaw=yaw))
    rig.ready_to_drive()
    rig.take(m.Statustext)
    rig.run(seconds, stream)
    return rig


def test_it_drives_towards_the_velocity_vector() -> None:
    rig = driven(velocity(1.2, 0.9), seconds=6.0)
    assert math.degrees(rig.truth.yaw) == pytest.approx(math.degrees(math.atan2(0.9, 1.2)), abs=1)
    assert rig.truth.forward_speed == pytest.approx(1.5, abs=0.02)


def test_it_turns_round_rather_than_reverse() -> None:
    rig = driven(velocity(-1.0), seconds=8.0)
    assert abs(math.degrees(rig.truth.yaw)) == pytest.approx(180.0, abs=1.0)
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.02)
    assert rig.truth.north < -2.0


def test_a_rover_that_honours_yaw_rate_turns_and_reverses() -> None:
    rig = Rig(replace(PX4, honours_yaw_rate=True))
    rig.ready_to_drive()
    rig.run(3.0, body_velocity(-0.5, yaw_rate=0.3))
    assert rig.truth.forward_speed == pytest.approx(-0.5, abs=0.02)
    assert rig.truth.yaw_rate == pytest.approx(0.3, abs=0.02)


def test_a_position_is_driven_to_while_it_streams() -> None:
    rig = driven(local_target(POSITION, position=(3.0, 2.0)), seconds=15.0)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((3.0, 2.0), abs=0.45)
    assert rig.take(m.MissionItemReached) == []
    single = Px4Rig()
    single.ready_to_drive()
    single.send(local_target(POSITION, position=(30.0, 0.0)))
    single.run(1.5)
    assert single.mode() != PX4_OFFBOARD  # one is no stream, also for a place


def test_what_a_rover_cannot_drive_keeps_offboard_alive_and_it_stands() -> None:
    for stream in [
        local_target(ACCELERATION),
        local_target(VELOCITY, velocity=(NAN, 1.0)),
        local_target(0x0DF7, velocity=(1.0, 1.0)),  # vx only
        local_target(POSITION, position=(NAN, 3.0)),
        local_target(0x0C00, frame=BODY_NED, position=(3.0, 0.0), velocity=(NAN, 1.0)),
    ]:
        rig = driven(stream)
        assert (rig.mode(), rig.truth.forward_speed) == (PX4_OFFBOARD, 0.0)
        assert rig.texts() == []


def test_what_counts_as_no_setpoint_is_told() -> None:
    for stream, text in [
        (local_target(0x0FFF), "Setpoint invalid: nothing given"),
        (local_target(VELOCITY, velocity=(NAN, NAN)), None),  # vz is still a number
        (local_target(POSITION, frame=BODY_NED), "Setpoint invalid: nothing given"),
        (local_target(0x0DD7, frame=BODY_NED), "Setpoint invalid: nothing given"),
        (local_target(VELOCITY, frame=LOCAL_OFFSET_NED), f"{LOCAL} coordinate frame 7 unsupported"),
        (local_target(VELOCITY, frame=12), f"{LOCAL} coordinate frame 12 unsupported"),
        (local_target(ACCELERATION | 512), "Setpoint with force unsupported"),
        (
            m.SetPositionTargetGlobalInt(0, 1, 1, 0, POSITION, *[0] * 3, *[0.0] * 8),
            "Setpoint frame 0 unsupported",
        ),
    ]:
        rig = driven(stream, seconds=1.5)
        assert (rig.mode() == PX4_OFFBOARD) is (text is None)
        assert rig.texts()[:1] == ([] if text is None else [text[:50]])


def test_no_number_crashes_it_or_moves_it() -> None:
    for mask in [VELOCITY, VELOCITY_AND_RATE, POSITION, 0, 0x0FFF]:
        for frame in [LOCAL_NED, BODY_NED, 20]:
            for value in [NAN, math.inf, -math.inf]:
                stream = m.SetPositionTargetLocalNed(0, 1, 1, frame, mask, *[value] * 11)
                assert driven(stream, seconds=0.5).truth.forward_speed == 0.0
