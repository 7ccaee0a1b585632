"""What a goal comes down to, leg after leg."""

from math import pi, radians

import pytest

from mav_tasks.kinds import Face, GoTo, LocalPlace, Move, Pose, Rotate, SingleGoal, Wait
from mav_tasks.kinds.base import FACE, WAY
from mav_tasks.kinds.path import bearing
from mav_tasks.tasks.task import Progress
from tests.unit.tasks.samples import ORIGIN

EAST_3 = LocalPlace(0.0, 3.0)


def test_a_way_is_facing_driving_turning_and_waiting() -> None:
    goal = GoTo(EAST_3, speed=0.7, yaw=pi, wait=4.0)
    legs = []
    poses = (ORIGIN, Pose(0, 0, pi / 2), Pose(0, 3, pi / 2), Pose(0, 3, pi))
    for leg, pose in enumerate(poses):
        anchor = goal.anchor_of(leg, pose, EAST_3)
        legs.append(goal.leg_of(Progress(anchor=anchor, leg=leg, target=EAST_3)))
    assert legs == [Rotate(pi / 2), Move(3.0, 0.7), Rotate(pi / 2), Wait(4.0)]
    goals = (
        Move(1.0),
        Face(1.0),
        GoTo(EAST_3),
        GoTo(EAST_3, wait=1.0),
        GoTo(EAST_3, yaw=0.0),
        goal,
    )
    assert [each.leg_count for each in goals] == [1, 1, 2, 3, 3, 4]
    progress = Progress(anchor=ORIGIN, leg=2, target=EAST_3)
    assert GoTo(EAST_3, wait=4.0).leg_of(progress) == Wait(4.0)


def test_the_way_counts_along_the_line_to_the_place_whatever_the_heading() -> None:
    pose = Pose(1.0, 0.0, 0.3)
    assert GoTo(EAST_3).anchor_of(FACE, pose, EAST_3) == pose
    assert GoTo(EAST_3).anchor_of(WAY, pose, LocalPlace(1.0, 5.0)) == Pose(1.0, 0.0, pi / 2)
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
        leg = goal.leg_of(Progress(anchor=Pose(0, 0, radians(have))))
        assert isinstance(leg, Rotate)
        assert leg.angle == pytest.approx(radians(turn), abs=1e-9)
        assert leg.rate == 0.5


def test_what_is_continued_from_here_began_where_its_end_is_right() -> None:
    goals: tuple[tuple[SingleGoal, float, Pose], ...] = (
        (Move(5.0), 2.0, Pose(10.0, -2.0, pi / 2)),
        (Move(-5.0), 2.0, Pose(10.0, 2.0, pi / 2)),
        (Rotate(pi), 1.0, Pose(10.0, 0.0, pi / 2 - 1.0)),
        (Rotate(-pi), 1.0, Pose(10.0, 0.0, pi / 2 + 1.0)),
        (Wait(5.0), 2.0, Pose(10.0, 0.0, pi / 2)),
    )
    for goal, done, anchor in goals:
        found = goal.begun_from(Pose(10.0, 0.0, pi / 2), done)
        wanted = anchor.north, anchor.east, anchor.yaw
        assert (found.north, found.east, found.yaw) == pytest.approx(wanted), goal
