"""A vehicle that does not go where it is told to."""

from math import cos, hypot, pi, radians, sin

import pytest

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import Drive, Move, Pose, SingleGoal
from mav_tasks.kinds.base import OFF_TRACK
from mav_tasks.kinds.guidance import ZERO, Motion, Velocity
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.watches import WRONG_WAY, AstrayWatch, JumpWatch
from mav_tasks.tasks.task import Progress
from tests.unit.tasks.samples import ORIGIN

TICK = 0.05
AHEAD, BACK = Velocity(0.5, 0.0), Velocity(-0.5, 0.0)
DRIVE = Drive(0.5, 0.0, 60.0)


class Rig:
    """A vehicle that moves as a test says, and its watch, at 20 Hz."""

    def __init__(self, goal: SingleGoal, asked: Velocity = AHEAD) -> None:
        self.now = 100.0
        self.course = PathFollower(goal, Progress(anchor=ORIGIN))
        self.watch = AstrayWatch()
        self.watch.commanded(asked)
        self.north = self.east = 0.0

    def drives(
        self, metres: float, north: float = 0.0, east: float = 0.0, yaw: float = 0.0
    ) -> float | None:
        """Return the metres after which it is found astray, None if it is not within so many."""
        speed = hypot(north, east)
        forward, sideways = north * cos(yaw) + east * sin(yaw), east * cos(yaw) - north * sin(yaw)
        for step in range(1, round(metres / speed / TICK) + 1):
            self.north += north * TICK
            self.east += east * TICK
            if self._is_astray(yaw, forward, sideways):
                return step * speed * TICK
        return None

    def is_moved_to(self, north: float, east: float) -> bool:
        """Whether it is found astray where its position is corrected to."""
        self.north, self.east = north, east
        return self._is_astray(0.0, 0.5, 0.0)

    def _is_astray(self, yaw: float, forward: float, sideways: float) -> bool:
        self.now += TICK
        pose = Pose(self.north, self.east, yaw)
        return self.watch.is_astray(self.course, Motion(pose, forward, sideways, 0.0, self.now))


def test_who_moves_otherwise_than_it_points_is_found_in_half_a_metre() -> None:
    for goal in (Move(10.0), DRIVE):
        for yaw in (pi, pi / 2, -pi / 2, radians(70)):
            found = Rig(goal).drives(2.0, north=0.5, yaw=yaw)
            assert found == pytest.approx(WRONG_WAY, abs=0.06), (goal, yaw)


def test_who_goes_where_it_points_or_reverses_is_not() -> None:
    for asked, north in ((AHEAD, 0.5), (BACK, -0.5)):
        assert Rig(Move(10.0), asked).drives(9.0, north) is None
        assert Rig(Move(10.0), asked).drives(9.0, -north) is not None


def test_a_reported_speed_that_its_position_contradicts_is_no_motion() -> None:
    """A PX4 with metre-class GPS reports up to 0.6 m/s sideways while it crawls ahead."""
    rig = Rig(Move(10.0))
    for step in range(1200):
        pose = Pose(0.02 * TICK * step, 0.1 * sin(step / 40), 0.0)
        motion = Motion(pose, 0.05, 0.3, 0.0, rig.now + TICK * step)
        assert not rig.watch.is_astray(rig.course, motion), step


def test_a_little_right_in_between_begins_anew_and_zeros_forget_nothing() -> None:
    rig = Rig(DRIVE)
    assert not any(rig.drives(*way) for way in 5 * ((0.4, -0.5), (0.1, 0.5)))
    rig = Rig(DRIVE)
    for _ in range(2):
        rig.watch.commanded(ZERO)
        rig.watch.begin_leg()
        rig.watch.commanded(AHEAD)
        found = rig.drives(0.3, north=-0.5)
    assert found is not None


def test_what_rolls_on_before_it_reverses_is_not_counted_until_it_has_stood() -> None:
    rig = Rig(Move(10.0))
    assert rig.drives(1.0, north=2.0) is None
    rig.watch.commanded(BACK)
    assert rig.drives(2.0, north=2.0) is None
    assert rig.drives(0.01, north=0.01) is None
    assert rig.drives(2.0, north=2.0) is not None


def test_who_leaves_its_line_is_found_at_a_metre_more_than_it_began_with() -> None:
    rig = Rig(Move(10.0))
    assert not rig.is_moved_to(0.0, 0.6)
    found = rig.drives(5.0, 0.4, 0.3, 0.5)
    assert found == pytest.approx(OFF_TRACK / 0.6, abs=0.1)
    back_and_forth = 4 * ((1.5, 0.4, 0.3, 0.5), (1.5, 0.4, -0.3, -0.5))
    rig = Rig(Move(10.0))
    assert not any(rig.drives(*way) for way in back_and_forth)


def test_a_corrected_position_is_not_driving_and_hides_none() -> None:
    rig = Rig(Move(10.0))
    assert rig.drives(1.0, 0.4, 0.3, 0.5) is None  # 0.6 m beside by driving
    assert not rig.is_moved_to(1.0, 1.9)
    assert not rig.is_moved_to(1.0, -0.4)
    assert rig.drives(3.0, 0.4, -0.3, -0.5) is not None


def test_a_heading_that_nobody_can_have_turned_by_is_a_jump() -> None:
    for turned, seconds, jumped in (
        (radians(40), 0.05, False),
        (radians(60), 0.05, True),
        (pi, 0.05, True),
        (pi, 1.0, False),  # it may have turned so far meanwhile
    ):
        watch = JumpWatch()
        for at, yaw in ((0.0, 3.0), (seconds, 3.0 + turned)):
            seen = Motion(Pose(0.0, 0.0, yaw), 0.0, 0.0, 0.0, at)
            found = watch.has_jumped(seen, driving=Driving())
        assert found is jumped, (turned, seconds)
