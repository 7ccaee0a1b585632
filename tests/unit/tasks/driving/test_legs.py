"""What a goal comes down to, leg after leg."""

from math import pi, radians

import pytest

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import ZERO, Leg, Velocity, wrap
from mav_tasks.tasks.driving.legs import (
    FACE,
    WAY,
    anchor_of,
    bearing,
    begun_from,
    first_leg,
    leg_count,
    leg_of,
    length_of,
)
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.goal import Drive, Face, GoTo, Head, LocalPlace, Move, Rotate, SingleGoal, Wait
from mav_tasks.tasks.task import Pose, Progress
from tests.unit.tasks.samples import ORIGIN, motion

DRIVING = Driving()
EAST_3 = LocalPlace(0.0, 3.0)


def test_a_way_is_facing_driving_turning_and_waiting() -> None:
    goal = GoTo(EAST_3, speed=0.7, yaw=pi, wait=4.0)
    legs = []
    poses = (ORIGIN, Pose(0, 0, pi / 2), Pose(0, 3, pi / 2), Pose(0, 3, pi))
    for leg, pose in enumerate(poses):
        anchor = anchor_of(goal, leg, pose, EAST_3)
        legs.append(leg_of(goal, Progress(anchor=anchor, leg=leg, target=EAST_3)))
    assert legs == [Rotate(pi / 2), Move(3.0, 0.7), Rotate(pi / 2), Wait(4.0)]
    goals = (
        Move(1.0),
        Face(1.0),
        GoTo(EAST_3),
        GoTo(EAST_3, wait=1.0),
        GoTo(EAST_3, yaw=0.0),
        goal,
    )
    assert [leg_count(each) for each in goals] == [1, 1, 2, 3, 3, 4]
    progress = Progress(anchor=ORIGIN, leg=2, target=EAST_3)
    assert leg_of(GoTo(EAST_3, wait=4.0), progress) == Wait(4.0)


def test_the_way_counts_along_the_line_to_the_place_whatever_the_heading() -> None:
    pose = Pose(1.0, 0.0, 0.3)
    assert anchor_of(GoTo(EAST_3), FACE, pose, EAST_3) == pose
    assert anchor_of(GoTo(EAST_3), WAY, pose, LocalPlace(1.0, 5.0)) == Pose(1.0, 0.0, pi / 2)
    assert bearing(Pose(1.0, 2.0, 0.7), LocalPlace(1.0, 2.0)) == 0.7  # of where one is: one's own


def test_facing_turns_the_way_that_was_asked() -> None:
    for have, want, direction, turn in (
        (0, 90, 0, 90),
        (0, 90, 1, 90),
        (0, 90, -1, -270),
        (0, -90, 1, 270),
        (0, -90, -1, -90),
        (170, -170, 0, 20),
        (-170, 170, 0, -20),
        (0, 180, 1, 180),
        (0, 180, -1, -180),
        (90, 90, 0, 0),
        (45, 405, -1, 0),
    ):
        goal = Face(radians(want), direction, 0.5)
        leg = leg_of(goal, Progress(anchor=Pose(0, 0, radians(have))))
        assert isinstance(leg, Rotate)
        assert leg.angle == pytest.approx(radians(turn), abs=1e-9)
        assert leg.rate == 0.5


def test_heading_relative_counts_from_the_start() -> None:
    progress = Progress(anchor=Pose(0, 0, -3.0))
    leg = leg_of(Head(-pi / 2, 0.5, 3.0, is_relative=True), progress)
    assert leg == Head(wrap(-3.0 - pi / 2), 0.5, 3.0)
    assert leg_of(Head(1.0, 0.5, 3.0), progress) == Head(1.0, 0.5, 3.0)


def test_lengths_are_unsigned_and_what_depends_on_the_start_is_not_known_before() -> None:
    legs: tuple[Leg, ...] = (
        *(Move(-2.0), Rotate(-pi), Drive(-1.0, 0.0, 3.0)),
        *(Head(0.0, -1.0, 4.0), Wait(5.0)),
    )
    assert [length_of(leg) for leg in legs] == [2.0, pi, 3.0, 4.0, 5.0]
    goals: tuple[SingleGoal, ...] = (GoTo(EAST_3), Face(1.0), Move(-2.0))
    assert [first_leg(goal) for goal in goals] == [None, None, Move(-2.0)]


def test_what_is_continued_from_here_began_where_its_end_is_right() -> None:
    goals: tuple[tuple[SingleGoal, float, Pose], ...] = (
        (Move(5.0), 2.0, Pose(10.0, -2.0, pi / 2)),
        (Move(-5.0), 2.0, Pose(10.0, 2.0, pi / 2)),
        (Rotate(pi), 1.0, Pose(10.0, 0.0, pi / 2 - 1.0)),
        (Rotate(-pi), 1.0, Pose(10.0, 0.0, pi / 2 + 1.0)),
        (Wait(5.0), 2.0, Pose(10.0, 0.0, pi / 2)),
    )
    for goal, done, anchor in goals:
        found = begun_from(goal, Pose(10.0, 0.0, pi / 2), done)
        wanted = anchor.north, anchor.east, anchor.yaw
        assert (found.north, found.east, found.yaw) == pytest.approx(wanted), goal


def test_a_course_advances_leg_by_leg_to_its_end() -> None:
    course = PathFollower(GoTo(EAST_3, wait=1.0), Progress(anchor=ORIGIN, target=EAST_3))
    for pose, elapsed, remaining, goes_on in (
        (Pose(0, 0, 1.5), 0.1, pi / 2 - 1.5, True),
        (Pose(0, 2.9, 1.5), 0.1, 0.1, True),
        (Pose(0, 2.99, 1.5), 0.4, 0.6, False),
    ):
        course.look(motion(pose, at=0.0), elapsed=elapsed)
        assert course.remaining == pytest.approx(remaining)
        assert course.advance(motion(pose, at=0.0)) is goes_on
        if goes_on:
            assert course.progress.done == 0.0


def test_near_enough_is_the_radius_of_the_place_and_of_nothing_else() -> None:
    course = PathFollower(GoTo(EAST_3, radius=0.5, yaw=0.0), Progress(anchor=ORIGIN, target=EAST_3))
    course.look(motion(Pose(0, 0, pi / 2 - 0.4), at=0.0), elapsed=0.1)
    assert not course.has_arrived(stands=True, driving=DRIVING)
    course.advance(motion(Pose(0, 0, pi / 2), at=0.0))
    for east, arrived in ((2.4, False), (2.51, True), (3.4, True)):
        course.look(motion(Pose(0, east, pi / 2), at=0.0), elapsed=0.1)
        assert course.has_arrived(stands=False, driving=DRIVING) is arrived, east


def test_zero_is_asked_for_nearer_to_the_end_than_is_required() -> None:
    course = PathFollower(Move(1.0), Progress(anchor=ORIGIN))
    course.look(motion(Pose(0.993, 0, 0), at=0.0), elapsed=0.1)
    assert [course.has_arrived(stands=s, driving=DRIVING) for s in (False, True)] == [False, True]


def test_a_speed_that_was_set_is_that_of_moves_and_headings() -> None:
    def steered(goal: SingleGoal, speed: float | None) -> Velocity:
        course = PathFollower(goal, Progress(anchor=ORIGIN))
        return course.steer(motion(at=0.0), driving=DRIVING, speed=speed)

    for goal in (Move(9.0, 0.2), Head(0.0, 0.2, 9.0)):
        assert [steered(goal, speed).forward for speed in (1.5, None)] == [1.5, 0.2]
    assert steered(Drive(0.2, 0.1, 9.0), 1.5) == Velocity(0.2, 0.1)
    assert steered(Wait(9.0), 1.5) == ZERO
