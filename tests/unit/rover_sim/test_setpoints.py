"""Which setpoints move an ArduPilot Rover, for how long, and which it drops in silence."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Message
from rover_sim.body import BodyState, Pose
from tests.unit.rover_sim.rig import (
    BODY_NED,
    GUIDED,
    HOLD,
    LOCAL_NED,
    LOCAL_OFFSET_NED,
    ORIGIN,
    POSITION,
    VELOCITY,
    Rig,
    local_target,
    velocity,
)

TIMEOUT_TEXT = "target not received last 3secs, stopping"


def driving(stream: Message, *, seconds: float = 3.0, start: Pose = ORIGIN) -> Rig:
    rig = Rig(start=start)
    rig.ready_to_drive()
    rig.take(m.Statustext)
    rig.run(seconds, stream)
    return rig


def moved(rig: Rig) -> bool:
    return rig.truth.forward_speed != 0.0 or rig.truth.yaw_rate != 0.0


def test_masks_that_drive() -> None:
    for mask in [0x0DC7, 0x0C47, 0x0DE7, 0x05C7, 0x09C7]:
        assert moved(driving(local_target(mask, velocity=(1.0, 0.0))))


def test_what_is_dropped_in_silence() -> None:
    for mask, why in [
        (0x0C07, "acceleration not ignored"),
        (0x0DF7, "vy ignored: the whole velocity counts as ignored"),
        (0x0DCF, "vx ignored: likewise"),
        (0x0FFF, "everything ignored"),
        (0x01C7, "yaw and yaw rate both given"),
        (VELOCITY, "a frame that it does not know"),
    ]:
        frame = 12 if mask == VELOCITY else LOCAL_NED
        rig = driving(local_target(mask, frame=frame, velocity=(1.0, 1.0)))
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


def way_from(rig: Rig, place: BodyState) -> float:
    return math.dist((place.north, place.east), (rig.truth.north, rig.truth.east))


def test_without_setpoints_it_drives_on_for_three_seconds_then_brakes() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.run(4.0, velocity(2.0))
    last = rig.truth
    rig.take(m.Statustext)
    rig.until(lambda: TIMEOUT_TEXT in rig.texts(), limit=4.0)
    assert way_from(rig, last) == pytest.approx(6.0, abs=0.2)
    assert rig.last(m.Statustext).severity == 4
    braking_from = rig.truth
    braking_time = rig.until(lambda: rig.truth.forward_speed == 0.0, limit=4.0)
    assert 1.8 < braking_time < 3.2
    assert way_from(rig, braking_from) == pytest.approx(2.3, abs=0.3)


def test_a_setpoint_sent_while_disarmed_is_kept_and_driven_when_armed() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0))
    rig.run(1.5)
    assert rig.truth.forward_speed == 0.0
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed > 0.5


def test_entering_guided_forgets_the_target_but_asking_again_does_not() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    rig.send(velocity(1.0))
    rig.set_mode(GUIDED)
    rig.arm()
    rig.run(1.0)
    assert rig.truth.forward_speed > 0.5
    rig.set_mode(HOLD)
    rig.set_mode(GUIDED)
    rig.run(3.0)
    assert rig.truth.forward_speed == 0.0
