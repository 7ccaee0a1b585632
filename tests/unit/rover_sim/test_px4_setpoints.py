"""Which setpoints move a PX4 rover, which only keep OFFBOARD alive, and which do neither."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.messages import Message
from rover_sim.body import Pose
from tests.unit.rover_sim.rig import (
    BODY_NED,
    LOCAL_OFFSET_NED,
    POSITION,
    PX4_OFFBOARD,
    VELOCITY,
    Px4Rig,
    Rig,
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


def test_it_turns_round_rather_than_reverse() -> None:
    rig = driven(velocity(-1.0), seconds=8.0)
    assert abs(math.degrees(rig.truth.yaw)) == pytest.approx(180.0, abs=1.0)
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.02)
    assert rig.truth.north < -2.0


def test_a_position_is_driven_to_while_it_streams() -> None:
    rig = driven(local_target(POSITION, position=(3.0, 2.0)), seconds=15.0)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((3.0, 2.0), abs=0.45)
    assert rig.take(m.MissionItemReached) == []
    single = Px4Rig()
    single.ready_to_drive()
    single.send(local_target(POSITION, position=(30.0, 0.0)))
    single.run(1.5)
    assert single.mode() != PX4_OFFBOARD  # one is no stream, also for a place


def test_what_is_no_motion_keeps_offboard_alive_or_is_told() -> None:
    """It stands on what it cannot drive; what is no setpoint ends OFFBOARD, with a text."""
    for stream, text in [
        (local_target(ACCELERATION), None),
        (local_target(VELOCITY, velocity=(NAN, 1.0)), None),
        (local_target(VELOCITY, velocity=(NAN, NAN)), None),  # vz is still a number
        (local_target(0x0DF7, velocity=(1.0, 1.0)), None),  # vx only
        (local_target(POSITION, position=(NAN, 3.0)), None),
        (local_target(0x0C00, frame=BODY_NED, position=(3.0, 0.0), velocity=(NAN, 1.0)), None),
        (local_target(0x0FFF), "Setpoint invalid: nothing given"),
        (local_target(POSITION, frame=BODY_NED), "Setpoint invalid: nothing given"),
        (local_target(VELOCITY, frame=LOCAL_OFFSET_NED), f"{LOCAL} coordinate frame 7 unsupported"),
        (local_target(ACCELERATION | 512), "Setpoint with force unsupported"),
        (
            m.SetPositionTargetGlobalInt(0, 1, 1, 0, POSITION, *[0] * 3, *[0.0] * 8),
            "Setpoint frame 0 unsupported",
        ),
    ]:
        rig = driven(stream, seconds=1.5)
        assert (rig.mode() == PX4_OFFBOARD) is (text is None)
        assert rig.texts()[:1] == ([] if text is None else [text[:50]])
        assert text or rig.truth.forward_speed == 0.0
