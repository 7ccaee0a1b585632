"""Which setpoints move an ArduPilot Rover, and which it drops in silence."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Message
from rover_sim.body import Pose
from rover_sim.errors import SimulatedCrash
from tests.unit.rover_sim.rig import (
    BODY_NED,
    GUIDED,
    HOLD,
    LOCAL_NED,
    LOCAL_OFFSET_NED,
    ORIGIN,
    POSITION,
    VELOCITY,
    VELOCITY_AND_RATE,
    Rig,
    local_target,
    velocity,
)


def driving(stream: Message, *, seconds: float = 3.0, start: Pose = ORIGIN) -> Rig:
    rig = Rig(start=start)
    rig.ready_to_drive()
    rig.take(m.Statustext)
    rig.run(seconds, stream)
    return rig


def moved(rig: Rig) -> bool:
    return rig.truth.forward_speed != 0.0 or rig.truth.yaw_rate != 0.0


def test_other_frames_are_dropped_in_silence() -> None:
    for frame in [0, 12, 20]:
        rig = driving(local_target(VELOCITY, frame=frame, velocity=(1.0, 0.0)))
        assert not moved(rig)
        assert rig.texts() == []


def test_masks_that_drive() -> None:
    for mask in [0x0DC7, 0x0C47, 0x0DE7, 0x05C7, 0x09C7]:
        assert moved(driving(local_target(mask, velocity=(1.0, 0.0))))


def test_masks_that_are_dropped_in_silence() -> None:
    for mask, why in [
        (0x0C07, "acceleration not ignored"),
        (0x0DF7, "vy ignored: the whole velocity counts as ignored"),
        (0x0DCF, "vx ignored: likewise"),
        (0x0FFF, "everything ignored"),
        (0x01C7, "yaw and yaw rate both given"),
    ]:
        rig = driving(local_target(mask, velocity=(1.0, 1.0)))
        assert not moved(rig), why
        assert rig.texts() == []


def test_velocity_steers_as_a_car_onto_its_direction() -> None:
    rig = driving(velocity(1.5, 1.5), seconds=6.0)
    assert math.degrees(rig.truth.yaw) == pytest.approx(45.0, abs=1.0)
    assert rig.truth.forward_speed == pytest.approx(math.hypot(1.5, 1.5), abs=0.05)
    # The arc bulges to the side that it faced at first (10.2 N, 7.8 E was seen on the real one).
    assert 0.5 < rig.truth.north - rig.truth.east < 3.0


def test_speed_is_limited_in_silence() -> None:
    for asked in (30.0, math.inf):
        rig = driving(velocity(asked), seconds=8.0)
        assert rig.truth.forward_speed == pytest.approx(4.0, abs=0.01)  # at full throttle
        assert rig.texts() == []


def test_pure_velocity_backwards_in_body_frame_turns_round_and_circles() -> None:
    rig = driving(local_target(VELOCITY, frame=BODY_NED, velocity=(-1.0, 0.0)), seconds=8.0)
    assert rig.truth.forward_speed > 0.9
    assert abs(rig.truth.yaw_rate) > 0.3  # relative to the present heading: it never arrives


def test_position_targets_are_driven_to_and_reported() -> None:
    for frame, goal in [
        (LOCAL_NED, (3.0, 2.0)),
        (LOCAL_OFFSET_NED, (4.0, 3.0)),
        (BODY_NED, (-1.0, 4.0)),
    ]:
        rig = Rig(start=Pose(north=1.0, east=1.0, yaw=math.radians(90)))
        rig.ready_to_drive()
        rig.take(m.MissionItemReached)
        rig.send(local_target(POSITION, frame=frame, position=(3.0, 2.0)))
        rig.run(15.0)  # once is enough: a place does not time out
        assert math.dist(goal, (rig.truth.north, rig.truth.east)) < 0.15
        assert rig.truth.forward_speed == 0.0
        assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [0]


def test_only_the_target_system_is_looked_at() -> None:
    for target, acted_on in [
        ((0, 0), True),
        ((1, 0), True),
        ((1, 99), True),
        ((2, 1), False),
        ((2, 0), False),
    ]:
        stream = local_target(VELOCITY, velocity=(1.0, 0.0), target=Address(*target))
        assert moved(driving(stream)) is acted_on


def test_setpoints_in_another_mode_are_dropped_in_silence() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.set_mode(HOLD)
    rig.take(m.Statustext)
    rig.run(3.0, velocity(1.0))
    assert not moved(rig)
    rig.set_mode(GUIDED)
    rig.run(1.0)
    assert not moved(rig)  # nothing was kept


def test_nan_velocity_crashes_as_the_real_one_even_disarmed() -> None:
    for mask in [VELOCITY, VELOCITY_AND_RATE]:
        rig = Rig()
        rig.set_mode(GUIDED)
        with pytest.raises(SimulatedCrash):
            rig.send(local_target(mask, velocity=(math.nan, 0.0)))
