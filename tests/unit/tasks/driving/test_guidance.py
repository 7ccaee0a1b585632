"""Geometry by hand: yaw clockwise from north, positions north and east."""

from math import pi, radians, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import Move, Pose, Rotate, Wait
from mav_tasks.kinds.guidance import CREEP_SPEED, ZERO, Situation, Velocity
from mav_tasks.kinds.path import wrap
from tests.unit.tasks.samples import motion

DRIVING = Driving()
HERE = Pose(0.0, 0.0, 0.0)  # facing north
EAST = pi / 2

lengths = st.floats(-1e4, 1e4)
poses = st.builds(Pose, lengths, lengths, st.floats(-pi, pi))


def steered(goal: Move | Rotate, pose: Pose) -> Velocity:
    done = goal.done_so_far(HERE, pose, before=0.0)
    return goal.steer(at(pose, remaining=goal.length - done))


def at(pose: Pose, *, remaining: float, anchor: Pose = HERE) -> Situation:
    return Situation(anchor, motion(pose, at=1.0), 0.0, remaining, DRIVING)


def test_a_move_counts_along_its_heading_and_a_rotation_clockwise() -> None:
    for goal, anchor, pose, done in (
        (Move(5.0), HERE, Pose(3.0, 1.0, 0.3), 3.0),  # sideways does not count
        (Move(-5.0), HERE, Pose(-1.0, 0.0, 0.0), 1.0),
        (Move(5.0), Pose(10.0, 20.0, -EAST), Pose(10.0, 18.5, 0.0), 1.5),
        (Move(5.0), Pose(0.0, 0.0, radians(45)), Pose(1.0, 1.0, 0.0), sqrt(2)),
        (Rotate(pi), HERE, Pose(0.0, 0.0, 0.5), 0.5),
        (Rotate(pi), Pose(0.0, 0.0, 3.0), Pose(0.0, 0.0, -3.0), 2 * pi - 6.0),  # through south
        (Rotate(-pi), Pose(0.0, 0.0, 3.0), Pose(0.0, 0.0, -3.0), 6.0 - 2 * pi),
    ):
        assert goal.done_so_far(anchor, pose, before=0.0) == pytest.approx(done), (goal, pose)


def test_a_rotation_counts_full_turns() -> None:
    for angle in (radians(400), radians(-400), radians(1080)):
        done = 0.0
        for step in range(1, 201):
            pose = Pose(0.0, 0.0, wrap(2.5 + angle * step / 200))
            done = Rotate(angle).done_so_far(Pose(0.0, 0.0, 2.5), pose, before=done)
        assert done == pytest.approx(abs(angle))


def test_on_its_line_it_moves_straight_and_off_it_steers_back() -> None:
    for sign in (1.0, -1.0):
        move = Move(sign * 10.0)
        assert steered(move, Pose(sign, 0.0, 0.0)) == Velocity(sign * DRIVING.speed, 0.0)
        for side in (1.0, -1.0):  # in reverse, nose right is tail left
            assert steered(move, Pose(sign, side * 0.3, 0.0)).yaw_rate * side * sign < -0.05
            assert steered(move, Pose(0.0, 0.0, side * 0.1)).yaw_rate * side < 0
    assert steered(Move(10.0, speed=1.5), HERE).forward == 1.5
    assert -DRIVING.speed < steered(Move(2.0), Pose(2.2, 0.0, 0.0)).forward < 0


@given(st.floats(1e-3, 20.0), st.sampled_from([1.0, -1.0]), st.floats(0.05, 2.0))
def test_the_approach_is_never_faster_than_can_be_braked(
    remaining: float, sign: float, speed: float
) -> None:
    goal = Move(sign * 20.0, speed=speed)
    now = at(HERE, remaining=remaining)
    wish = goal.steer(now)
    can_brake = sqrt(2 * DRIVING.acceleration * remaining)
    assert 0 < wish.forward * sign <= max(CREEP_SPEED, min(speed, can_brake))
    turn = Rotate(sign * 62.0).steer(now)
    can_brake = sqrt(2 * DRIVING.turn_acceleration * remaining)
    assert 0 < turn.yaw_rate * sign <= max(0.03, min(DRIVING.turn_rate, can_brake))


def test_it_has_arrived_within_the_tolerance() -> None:
    for goal, remaining, arrived in (
        (Move(2.0), 0.01, True),
        (Move(2.0), -0.01, True),
        (Move(2.0), 0.011, False),
        (Rotate(1.0), radians(0.49), True),
        (Rotate(1.0), radians(-0.51), False),
    ):
        within = {"metres": DRIVING.arrival_distance, "angle": DRIVING.arrival_angle}
        assert goal.is_within(remaining, **within) is arrived
    assert not Wait(3.0).is_within(0.1, metres=1.0, angle=1.0)
    assert Wait(3.0).steer(at(HERE, remaining=0.1)) == ZERO


@given(
    st.one_of(
        st.builds(Move, st.floats(-1e4, 1e4).filter(bool), st.none() | st.floats(0.01, 2.0)),
        st.builds(Rotate, st.floats(-63, 63).filter(bool), st.none() | st.floats(0.01, 1.5)),
    ),
    *(poses, poses, st.floats(-1e4, 1e4)),
)
def test_no_pose_makes_anything_but_bounded_numbers(
    goal: Move | Rotate, anchor: Pose, pose: Pose, remaining: float
) -> None:
    wish = goal.steer(at(pose, remaining=remaining, anchor=anchor))
    assert abs(wish.forward) <= DRIVING.max_speed
    assert abs(wish.yaw_rate) <= DRIVING.max_turn_rate
