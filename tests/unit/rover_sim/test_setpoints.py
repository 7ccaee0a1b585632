"""Which setpoints move an ArduPilot Rover, and which it drops in silence."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Message
from rover_sim.body import Pose
from rover_sim.errors import SimulatedCrash
from rover_sim.geo import DEFAULT_ORIGIN
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
    VELOCITY_AND_YAW,
    Rig,
    body_velocity,
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


@pytest.mark.parametrize("frame", [1, 7, 8, 9])
def test_velocity_is_acted_on_in_local_and_body_frames(frame: int) -> None:
    rig = driving(local_target(VELOCITY, frame=frame, velocity=(1.0, 0.0)))
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("frame", [0, 12, 20])
def test_other_frames_are_dropped_in_silence(frame: int) -> None:
    rig = driving(local_target(VELOCITY, frame=frame, velocity=(1.0, 0.0)))
    assert not moved(rig)
    assert rig.texts() == []


@pytest.mark.parametrize("mask", [0x0DC7, 0x0C47, 0x0DE7, 0x05C7, 0x09C7])
def test_masks_that_drive(mask: int) -> None:
    assert moved(driving(local_target(mask, velocity=(1.0, 0.0))))


@pytest.mark.parametrize(
    ("mask", "why"),
    [
        (0x0C07, "acceleration not ignored"),
        (0x0DF7, "vy ignored: the whole velocity counts as ignored"),
        (0x0DCF, "vx ignored: likewise"),
        (0x0FFF, "everything ignored"),
        (0x01C7, "yaw and yaw rate both given"),
    ],
)
def test_masks_that_are_dropped_in_silence(mask: int, why: str) -> None:
    rig = driving(local_target(mask, velocity=(1.0, 1.0)))
    assert not moved(rig), why
    assert rig.texts() == []


def test_no_setpoint_is_ever_answered() -> None:
    rig = Rig()
    rig.ready_to_drive()
    rig.take(m.Statustext)
    rig.send(velocity(1.0), velocity(1.0), local_target(0x0C07))
    assert rig.heard == []


def test_velocity_steers_as_a_car_onto_its_direction() -> None:
    rig = driving(velocity(1.5, 1.5), seconds=6.0)
    assert math.degrees(rig.truth.yaw) == pytest.approx(45.0, abs=1.0)
    assert rig.truth.forward_speed == pytest.approx(math.hypot(1.5, 1.5), abs=0.05)
    # The arc bulges to the side that it faced at first (10.2 N, 7.8 E was seen on the real one).
    assert 0.5 < rig.truth.north - rig.truth.east < 3.0


def test_zero_velocity_in_local_frame_turns_nothing() -> None:
    rig = driving(velocity(0.0), start=Pose(yaw=1.0))
    assert rig.truth.yaw == pytest.approx(1.0)
    assert not moved(rig)


def test_speed_is_limited_in_silence() -> None:
    for asked in (30.0, math.inf):
        rig = driving(velocity(asked), seconds=8.0)
        assert rig.truth.forward_speed == pytest.approx(4.0, abs=0.01)  # at full throttle
        assert rig.texts() == []


def test_two_metres_a_second_are_reached_in_about_two_seconds() -> None:
    rig = driving(velocity(2.0), seconds=2.3)
    assert rig.truth.forward_speed == pytest.approx(2.0, abs=0.15)


def test_pure_velocity_backwards_in_body_frame_turns_round_and_circles() -> None:
    rig = driving(local_target(VELOCITY, frame=BODY_NED, velocity=(-1.0, 0.0)), seconds=8.0)
    assert rig.truth.forward_speed > 0.9
    assert abs(rig.truth.yaw_rate) > 0.3  # relative to the present heading: it never arrives


def test_velocity_with_yaw_rate_reverses() -> None:
    rig = driving(body_velocity(-1.0))
    assert rig.truth.forward_speed == pytest.approx(-1.0, abs=0.05)
    assert rig.truth.north < -1.0
    assert rig.truth.yaw == pytest.approx(0.0, abs=1e-6)


def test_velocity_with_yaw_rate_turns_on_the_spot() -> None:
    rig = driving(body_velocity(0.0, yaw_rate=0.5), seconds=2.0)
    assert rig.truth.yaw_rate == pytest.approx(0.5, abs=0.02)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_velocity_with_yaw_keeps_that_heading() -> None:
    stream = local_target(VELOCITY_AND_YAW, velocity=(1.0, 0.0), yaw=math.radians(90))
    rig = driving(stream, seconds=8.0)
    assert math.degrees(rig.truth.yaw) == pytest.approx(90.0, abs=1.0)
    assert rig.truth.forward_speed == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("frame", "goal"),
    [(LOCAL_NED, (3.0, 2.0)), (LOCAL_OFFSET_NED, (4.0, 3.0)), (BODY_NED, (-1.0, 4.0))],
)
def test_position_targets_are_driven_to_and_reported(frame: int, goal: tuple[float, float]) -> None:
    rig = Rig(start=Pose(north=1.0, east=1.0, yaw=math.radians(90)))
    rig.ready_to_drive()
    rig.take(m.MissionItemReached)
    rig.send(local_target(POSITION, frame=frame, position=(3.0, 2.0)))
    rig.run(15.0)  # once is enough: a place does not time out
    assert math.dist(goal, (rig.truth.north, rig.truth.east)) < 0.15
    assert rig.truth.forward_speed == 0.0
    assert [reached.seq for reached in rig.take(m.MissionItemReached)] == [0]


def test_position_wins_over_velocity() -> None:
    rig = driving(local_target(0x0DC0, position=(2.0, 0.0), velocity=(0.0, 3.0)), seconds=8.0)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((2.0, 0.0), abs=0.15)


def test_global_position_target_is_driven_to_and_shown() -> None:
    rig = Rig()
    rig.ready_to_drive()
    latitude, longitude = DEFAULT_ORIGIN.to_global(3.0, 1.0)
    target = m.SetPositionTargetGlobalInt(
        0, 1, 1, 6, POSITION, latitude, longitude, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )
    rig.send(target)
    rig.run(2.0)
    shown = rig.last(m.PositionTargetGlobalInt)
    assert (shown.lat_int, shown.lon_int) == pytest.approx((latitude, longitude), abs=1)
    rig.run(10.0)
    assert (rig.truth.north, rig.truth.east) == pytest.approx((3.0, 1.0), abs=0.15)
    rig.take(m.Heartbeat)
    rig.run(2.0)
    assert rig.take(m.PositionTargetGlobalInt) == []


@pytest.mark.parametrize(
    ("target", "acted_on"),
    [((0, 0), True), ((1, 0), True), ((1, 99), True), ((2, 1), False), ((2, 0), False)],
)
def test_only_the_target_system_is_looked_at(target: tuple[int, int], acted_on: bool) -> None:
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


@pytest.mark.parametrize("mask", [VELOCITY, VELOCITY_AND_RATE])
def test_nan_velocity_crashes_as_the_real_one_even_disarmed(mask: int) -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    with pytest.raises(SimulatedCrash):
        rig.send(local_target(mask, velocity=(math.nan, 0.0)))


def test_nan_yaw_rate_crashes_too() -> None:
    rig = Rig()
    rig.set_mode(GUIDED)
    with pytest.raises(SimulatedCrash):
        rig.send(body_velocity(0.0, yaw_rate=math.nan))


def test_nan_in_ignored_fields_is_harmless() -> None:
    nan = math.nan
    stream = m.SetPositionTargetLocalNed(
        0, 1, 1, 1, VELOCITY, nan, nan, nan, 1.0, 0.0, nan, nan, nan, nan, nan, nan
    )
    assert driving(stream).truth.forward_speed == pytest.approx(1.0, abs=0.05)
