"""The body without a physics engine."""

import math

import pytest

from rover_sim.body import BodyState, Pose
from rover_sim.kinematic import KinematicBody

ORIGIN = Pose()


def drive(body: KinematicBody, speed: float, yaw_rate: float, seconds: float) -> BodyState:
    body.drive(speed, yaw_rate)
    for _ in range(round(seconds * 40)):
        body.advance(1 / 40)
    return body.state


def body(*, start: Pose = ORIGIN, slip: float = 0.0, seed: int | None = None) -> KinematicBody:
    return KinematicBody(start=start, slip=slip, seed=seed)


def test_it_stands_where_it_was_put() -> None:
    state = body(start=Pose(north=2.0, east=3.0, yaw=4.0)).state
    assert (state.north, state.east) == (2.0, 3.0)
    assert state.yaw == pytest.approx(4.0 - math.tau)


def test_it_drives_along_its_heading() -> None:
    state = drive(body(start=Pose(yaw=math.radians(90))), 1.0, 0.0, 5.0)
    assert state.east == pytest.approx(5.0, abs=0.2)
    assert state.north == pytest.approx(0.0, abs=1e-6)
    assert state.forward_speed == 1.0


def test_positive_yaw_rate_turns_clockwise_on_the_spot() -> None:
    state = drive(body(), 0.0, 0.5, 2.0)
    assert state.yaw == pytest.approx(1.0, abs=0.1)
    assert (state.north, state.east) == (0.0, 0.0)


def test_a_steady_turn_is_a_circle() -> None:
    rover = body()
    drive(rover, 1.0, 0.5, 2.0)
    before = rover.state
    after = drive(rover, 1.0, 0.5, math.tau / 0.5)
    assert math.dist((before.north, before.east), (after.north, after.east)) < 0.05


def test_zero_demand_ends_at_an_exact_stand() -> None:
    rover = body()
    drive(rover, 2.0, 0.3, 3.0)
    state = drive(rover, 0.0, 0.0, 2.0)
    assert (state.forward_speed, state.yaw_rate) == (0.0, 0.0)
    later = drive(rover, 0.0, 0.0, 2.0)
    assert (later.north, later.east, later.yaw) == (state.north, state.east, state.yaw)


def test_acceleration_is_limited() -> None:
    assert drive(body(), 20.0, 0.0, 1.0).forward_speed <= 6.0 + 1e-9


def test_slip_costs_yaw_rate() -> None:
    assert drive(body(slip=0.3), 0.0, 1.0, 2.0).yaw_rate == pytest.approx(0.7)


def test_a_seed_varies_bodies_and_repeats_them() -> None:
    rates = [drive(body(slip=0.3, seed=seed), 0.0, 1.0, 2.0).yaw_rate for seed in (1, 2, 1)]
    assert rates[0] == rates[2]
    assert rates[0] != rates[1]
    assert all(0.6 < rate < 0.8 for rate in rates)


def test_long_advances_equal_short_ones() -> None:
    long, short = body(), body()
    long.drive(1.0, 0.5)
    long.advance(2.0)
    assert (
        math.dist(
            (long.state.north, long.state.east),
            (drive(short, 1.0, 0.5, 2.0).north, short.state.east),
        )
        < 0.01
    )


def test_slip_must_leave_some_grip() -> None:
    with pytest.raises(ValueError, match="slip"):
        body(slip=1.0)
