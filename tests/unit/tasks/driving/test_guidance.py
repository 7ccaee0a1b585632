"""Geometry by hand: yaw clockwise from north, positions north and east."""

from math import inf, pi, radians, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import (
    CREEP_SPEED,
    ZERO,
    Motion,
    Velocity,
    cross_track,
    done_so_far,
    has_arrived,
    steer,
    wrap,
)
from mav_tasks.tasks.goal import Move, Rotate
from mav_tasks.tasks.task import Pose

DRIVING = Driving()
NORTHWARDS = Pose(0.0, 0.0, 0.0)
EASTWARDS = Pose(0.0, 0.0, pi / 2)

lengths = st.floats(-1e4, 1e4)
angles = st.floats(-4 * pi, 4 * pi)
poses = st.builds(Pose, lengths, lengths, st.floats(-pi, pi))


def steered(
    goal: Move | Rotate, pose: Pose, *, anchor: Pose = NORTHWARDS, before: float = 0.0
) -> Velocity:
    length = abs(goal.distance) if isinstance(goal, Move) else abs(goal.angle)
    done = done_so_far(goal, anchor, pose, before=before)
    return steer(goal, anchor, pose, remaining=length - done, driving=DRIVING)


class TestProgress:
    @pytest.mark.parametrize(
        ("anchor", "pose", "done"),
        [
            (NORTHWARDS, Pose(3.0, 0.0, 0.0), 3.0),
            (NORTHWARDS, Pose(3.0, 1.0, 0.3), 3.0),  # sideways does not count
            (NORTHWARDS, Pose(-1.0, 0.0, 0.0), -1.0),
            (EASTWARDS, Pose(0.0, 2.0, pi / 2), 2.0),
            (Pose(10.0, 20.0, -pi / 2), Pose(10.0, 18.5, 0.0), 1.5),
            (Pose(0.0, 0.0, radians(45)), Pose(1.0, 1.0, 0.0), sqrt(2)),
        ],
    )
    def test_of_a_move_is_along_the_anchors_heading(
        self, anchor: Pose, pose: Pose, done: float
    ) -> None:
        assert done_so_far(Move(5.0), anchor, pose, before=0.0) == pytest.approx(done)
        assert done_so_far(Move(-5.0), anchor, pose, before=0.0) == pytest.approx(-done)

    @pytest.mark.parametrize(
        ("yaw_from", "yaw_to", "turned"),
        [
            (0.0, radians(30), radians(30)),
            (radians(170), radians(-170), radians(20)),  # through south
            (radians(-170), radians(170), radians(-20)),
        ],
    )
    def test_of_a_rotation_is_what_was_turned_clockwise(
        self, yaw_from: float, yaw_to: float, turned: float
    ) -> None:
        anchor, pose = Pose(0, 0, yaw_from), Pose(0, 0, yaw_to)
        assert done_so_far(Rotate(pi), anchor, pose, before=0.0) == pytest.approx(turned)
        assert done_so_far(Rotate(-pi), anchor, pose, before=0.0) == pytest.approx(-turned)

    @pytest.mark.parametrize("angle", [radians(400), radians(-400), radians(1080)])
    def test_of_a_rotation_counts_full_turns(self, angle: float) -> None:
        anchor, done, steps = Pose(0, 0, 2.5), 0.0, 200
        for step in range(1, steps + 1):
            pose = Pose(0, 0, wrap(2.5 + angle * step / steps))
            done = done_so_far(Rotate(angle), anchor, pose, before=done)
        assert done == pytest.approx(abs(angle))


class TestCrossTrack:
    @pytest.mark.parametrize(
        ("anchor", "pose", "right"),
        [
            (NORTHWARDS, Pose(5.0, 0.5, 0.0), 0.5),  # east of a line to the north: right
            (NORTHWARDS, Pose(5.0, -0.5, 0.0), -0.5),
            (EASTWARDS, Pose(-0.5, 5.0, 0.0), 0.5),  # south of a line to the east: right
            (Pose(0.0, 0.0, pi), Pose(-5.0, -0.5, 0.0), 0.5),  # west of a line to the south
        ],
    )
    def test_is_positive_to_the_right_of_the_line(
        self, anchor: Pose, pose: Pose, right: float
    ) -> None:
        assert cross_track(anchor, pose) == pytest.approx(right)


class TestMoving:
    def test_straight_ahead_on_the_line(self) -> None:
        assert steered(Move(10.0), Pose(1.0, 0.0, 0.0)) == Velocity(DRIVING.speed, 0.0)

    def test_backwards_on_the_line(self) -> None:
        assert steered(Move(-10.0), Pose(-1.0, 0.0, 0.0)) == Velocity(-DRIVING.speed, 0.0)

    @pytest.mark.parametrize(
        ("goal", "east", "turn"),
        [
            (Move(10.0), 0.3, -1),  # right of the line, going north: steer left
            (Move(10.0), -0.3, 1),
            (Move(-10.0), 0.3, 1),  # right of it, going backwards: nose right, tail left
            (Move(-10.0), -0.3, -1),
        ],
    )
    def test_off_the_line_it_steers_back_forward_and_in_reverse(
        self, goal: Move, east: float, turn: int
    ) -> None:
        north = 1.0 if goal.distance > 0 else -1.0
        assert steered(goal, Pose(north, east, 0.0)).yaw_rate * turn > 0.05

    @pytest.mark.parametrize("distance", [10.0, -10.0])
    def test_a_wrong_heading_is_turned_back_both_ways(self, distance: float) -> None:
        pose_right, pose_left = Pose(0, 0, 0.1), Pose(0, 0, -0.1)
        assert steered(Move(distance), pose_right).yaw_rate < 0
        assert steered(Move(distance), pose_left).yaw_rate > 0

    @pytest.mark.parametrize("distance", [4.0, -4.0])
    @pytest.mark.parametrize("start_east", [0.4, -0.4])
    def test_a_point_that_follows_it_ends_on_the_line_and_at_its_end(
        self, distance: float, start_east: float
    ) -> None:
        north, east, yaw, dt = 0.0, start_east, 0.0, 0.02
        goal = Move(distance)
        for _ in range(3000):
            pose = Pose(north, east, yaw)
            remaining = abs(distance) - done_so_far(goal, NORTHWARDS, pose, before=0.0)
            if has_arrived(goal, remaining, within=1.0, driving=DRIVING):
                break
            wish = steer(goal, NORTHWARDS, pose, remaining=remaining, driving=DRIVING)
            north += wish.forward * dt * (1 - yaw * yaw / 2)
            east += wish.forward * dt * yaw
            yaw = wrap(yaw + wish.yaw_rate * dt)
        assert north == pytest.approx(distance, abs=0.02)
        assert abs(east) < 0.05
        assert abs(yaw) < 0.1

    def test_past_its_end_it_comes_back_slowly(self) -> None:
        wish = steered(Move(2.0), Pose(2.2, 0.0, 0.0))
        assert -DRIVING.speed < wish.forward < 0

    def test_a_speed_of_its_own_is_kept_to(self) -> None:
        assert steered(Move(10.0, speed=1.5), NORTHWARDS).forward == 1.5

    @given(st.floats(1e-3, 20.0), st.sampled_from([1.0, -1.0]), st.floats(0.05, 2.0))
    def test_the_approach_is_never_faster_than_can_be_braked(
        self, remaining: float, sign: float, speed: float
    ) -> None:
        goal = Move(sign * 20.0, speed=speed)
        wish = steer(goal, NORTHWARDS, NORTHWARDS, remaining=remaining, driving=DRIVING)
        can_brake = sqrt(2 * DRIVING.acceleration * remaining)
        assert abs(wish.forward) <= max(CREEP_SPEED, min(speed, can_brake))
        assert wish.forward * sign > 0


class TestRotating:
    @pytest.mark.parametrize(
        ("angle", "direction"), [(pi / 2, 1), (-pi / 2, -1), (radians(270), 1), (-3 * pi, -1)]
    )
    def test_it_turns_the_way_that_was_asked_even_the_long_way(
        self, angle: float, direction: int
    ) -> None:
        wish = steered(Rotate(angle), NORTHWARDS)
        assert (wish.forward, wish.yaw_rate * direction > 0) == (0.0, True)

    def test_too_far_it_turns_back(self) -> None:
        assert steered(Rotate(1.0), Pose(0, 0, 1.1)).yaw_rate < 0
        assert steered(Rotate(-1.0), Pose(0, 0, -1.1)).yaw_rate > 0

    @given(st.floats(1e-3, 60.0), st.sampled_from([1.0, -1.0]))
    def test_the_approach_is_never_faster_than_can_be_braked(
        self, remaining: float, sign: float
    ) -> None:
        goal = Rotate(sign * 62.0)
        wish = steer(goal, NORTHWARDS, NORTHWARDS, remaining=remaining, driving=DRIVING)
        can_brake = sqrt(2 * DRIVING.turn_acceleration * remaining)
        assert abs(wish.yaw_rate) <= max(0.03, min(DRIVING.turn_rate, can_brake))


@pytest.mark.parametrize(
    ("goal", "remaining", "arrived"),
    [
        (Move(2.0), 0.01, True),
        (Move(2.0), -0.01, True),
        (Move(2.0), 0.011, False),
        (Rotate(1.0), radians(0.49), True),
        (Rotate(1.0), radians(-0.51), False),
    ],
)
def test_it_has_arrived_within_the_tolerance(
    goal: Move | Rotate, remaining: float, arrived: bool
) -> None:
    assert has_arrived(goal, remaining, within=1.0, driving=DRIVING) is arrived
    assert has_arrived(goal, remaining / 2, within=0.5, driving=DRIVING) is arrived


@given(
    st.one_of(
        st.builds(Move, st.floats(-1e4, 1e4).filter(bool), st.none() | st.floats(0.01, 2.0)),
        st.builds(Rotate, st.floats(-63, 63).filter(bool), st.none() | st.floats(0.01, 1.5)),
    ),
    poses,
    poses,
    st.floats(-1e4, 1e4),
)
def test_no_pose_makes_anything_but_bounded_numbers(
    goal: Move | Rotate, anchor: Pose, pose: Pose, remaining: float
) -> None:
    wish = steer(goal, anchor, pose, remaining=remaining, driving=DRIVING)
    assert abs(wish.forward) <= DRIVING.max_speed
    assert abs(wish.yaw_rate) <= DRIVING.max_turn_rate


@given(angles)
def test_wrapping_keeps_the_direction(angle: float) -> None:
    wrapped = wrap(angle)
    assert -pi <= wrapped <= pi
    assert wrap(angle - wrapped) == pytest.approx(0.0, abs=1e-9)


def test_speed_is_over_ground() -> None:
    assert Motion(NORTHWARDS, 3.0, 4.0, 0.0, at=0.0).speed == 5.0


def test_zero_is_zero() -> None:
    assert (ZERO.is_zero, Velocity(0.0, 1e-9).is_zero, Velocity(-inf, 0.0).is_zero) == (
        True,
        False,
        False,
    )
