"""What a goal comes down to, leg after leg, and how a rover that obeys drives it."""

from math import hypot, pi, radians

import pytest

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import ZERO, Leg, Motion, Velocity, wrap
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
from mav_tasks.tasks.goal import (
    Drive,
    Face,
    GlobalPlace,
    GoTo,
    Head,
    LocalPlace,
    Move,
    Rotate,
    SingleGoal,
    Wait,
)
from mav_tasks.tasks.lifecycle import TaskState
from mav_tasks.tasks.task import Frame, Pose, Progress
from tests.unit.tasks.rig import Rig, Rover, run_until
from tests.unit.tasks.samples import ORIGIN, motion

S = TaskState
DRIVING = Driving()
EAST_3 = LocalPlace(0.0, 3.0)
ON_EARTH = GlobalPlace(473_977_418, 85_455_938)


class TestLegs:
    @pytest.mark.parametrize(
        ("goal", "count"),
        [
            (Move(1.0), 1),
            (Face(1.0), 1),
            (GoTo(EAST_3), 2),
            (GoTo(EAST_3, wait=1.0), 3),
            (GoTo(EAST_3, yaw=0.0), 3),
            (GoTo(EAST_3, yaw=0.0, wait=1.0), 4),
        ],
    )
    def test_a_goal_has_as_many_as_it_asks_for(self, goal: SingleGoal, count: int) -> None:
        assert leg_count(goal) == count

    def test_a_way_is_facing_driving_turning_and_waiting(self) -> None:
        goal = GoTo(EAST_3, speed=0.7, yaw=pi, wait=4.0)
        legs = []
        for leg, pose in enumerate(
            [ORIGIN, Pose(0, 0, pi / 2), Pose(0, 3, pi / 2), Pose(0, 3, pi)]
        ):
            anchor = anchor_of(goal, leg, pose, EAST_3)
            legs.append(leg_of(goal, Progress(anchor=anchor, leg=leg, target=EAST_3)))
        assert legs == [Rotate(pi / 2), Move(3.0, 0.7), Rotate(pi / 2), Wait(4.0)]

    def test_without_a_heading_the_wait_follows_the_way(self) -> None:
        progress = Progress(anchor=ORIGIN, leg=2, target=EAST_3)
        assert leg_of(GoTo(EAST_3, wait=4.0), progress) == Wait(4.0)

    def test_the_way_counts_along_the_line_to_the_place_whatever_the_heading(self) -> None:
        pose = Pose(1.0, 0.0, 0.3)
        assert anchor_of(GoTo(EAST_3), FACE, pose, EAST_3) == pose
        assert anchor_of(GoTo(EAST_3), WAY, pose, LocalPlace(1.0, 5.0)) == Pose(1.0, 0.0, pi / 2)

    @pytest.mark.parametrize(
        ("have", "want", "direction", "turn"),
        [
            (0, 90, 0, 90),
            (0, 90, 1, 90),
            (0, 90, -1, -270),
            (0, -90, 0, -90),
            (0, -90, 1, 270),
            (0, -90, -1, -90),
            (170, -170, 0, 20),
            (170, -170, -1, -340),
            (-170, 170, 0, -20),
            (-170, 170, 1, 340),
            (0, 180, 1, 180),
            (0, 180, -1, -180),
            (90, 90, 0, 0),
            (45, 405, -1, 0),
        ],
    )
    def test_facing_turns_the_way_that_was_asked(
        self, have: float, want: float, direction: int, turn: float
    ) -> None:
        anchor = Pose(0, 0, radians(have))
        leg = leg_of(Face(radians(want), direction, 0.5), Progress(anchor=anchor))
        assert isinstance(leg, Rotate)
        assert leg.angle == pytest.approx(radians(turn), abs=1e-9)
        assert leg.rate == 0.5

    def test_heading_relative_counts_from_the_start(self) -> None:
        goal = Head(-pi / 2, 0.5, 3.0, is_relative=True)
        leg = leg_of(goal, Progress(anchor=Pose(0, 0, -3.0)))
        assert isinstance(leg, Head)
        assert leg.yaw == pytest.approx(wrap(-3.0 - pi / 2))
        assert not leg.is_relative
        assert leg_of(Head(1.0, 0.5, 3.0), Progress(anchor=Pose(0, 0, -3.0))) == Head(1.0, 0.5, 3.0)

    def test_lengths_are_unsigned_metres_radians_or_seconds(self) -> None:
        legs: list[Leg] = [
            Move(-2.0),
            Rotate(-pi),
            Drive(-1.0, 0.0, 3.0),
            Head(0.0, -1.0, 4.0),
            Wait(5.0),
        ]
        assert [length_of(leg) for leg in legs] == [2.0, pi, 3.0, 4.0, 5.0]

    def test_the_first_leg_of_what_depends_on_the_start_is_not_known_before(self) -> None:
        assert (first_leg(GoTo(EAST_3)), first_leg(Face(1.0))) == (None, None)
        assert first_leg(Move(1.0)) == Move(1.0)

    @pytest.mark.parametrize(
        ("goal", "done", "anchor"),
        [
            (Move(5.0), 2.0, Pose(10.0, -2.0, pi / 2)),
            (Move(-5.0), 2.0, Pose(10.0, 2.0, pi / 2)),
            (Rotate(pi), 1.0, Pose(10.0, 0.0, pi / 2 - 1.0)),
            (Rotate(-pi), 1.0, Pose(10.0, 0.0, pi / 2 + 1.0)),
            (Wait(5.0), 2.0, Pose(10.0, 0.0, pi / 2)),
        ],
    )
    def test_what_is_continued_from_here_began_where_its_end_is_right(
        self, goal: SingleGoal, done: float, anchor: Pose
    ) -> None:
        started = begun_from(goal, Pose(10.0, 0.0, pi / 2), done)
        assert (started.north, started.east, started.yaw) == pytest.approx(
            (anchor.north, anchor.east, anchor.yaw)
        )

    def test_the_bearing_of_where_one_is_is_ones_own(self) -> None:
        assert bearing(Pose(1.0, 2.0, 0.7), LocalPlace(1.0, 2.0)) == 0.7


class TestCourse:
    def moved(self, pose: Pose) -> Motion:
        return motion(pose, at=0.0)

    def test_looks_advances_and_comes_to_an_end(self) -> None:
        course = PathFollower(GoTo(EAST_3, wait=1.0), Progress(anchor=ORIGIN, target=EAST_3))
        course.look(self.moved(Pose(0, 0, 1.0)), elapsed=0.1)
        assert course.remaining == pytest.approx(pi / 2 - 1.0)
        assert course.advance(self.moved(Pose(0, 0, 1.5)))
        assert (course.progress.leg, course.progress.done) == (WAY, 0.0)
        course.look(self.moved(Pose(0, 2.9, 1.5)), elapsed=0.1)
        assert course.remaining == pytest.approx(0.1)
        assert course.advance(self.moved(Pose(0, 2.99, 1.5)))
        course.look(self.moved(Pose(0, 2.99, 1.5)), elapsed=0.4)
        assert course.remaining == pytest.approx(0.6)
        assert not course.advance(self.moved(Pose(0, 2.99, 1.5)))

    def test_near_enough_is_the_radius_of_the_place_and_of_nothing_else(self) -> None:
        goal = GoTo(EAST_3, radius=0.5, yaw=0.0)
        course = PathFollower(goal, Progress(anchor=ORIGIN, target=EAST_3))
        course.look(self.moved(Pose(0, 0, pi / 2 - 0.4)), elapsed=0.1)
        assert not course.has_arrived(stands=True, driving=DRIVING)
        course.advance(self.moved(Pose(0, 0, pi / 2)))
        for east, arrived in ((2.4, False), (2.51, True), (3.4, True)):
            course.look(self.moved(Pose(0, east, pi / 2)), elapsed=0.1)
            assert course.has_arrived(stands=False, driving=DRIVING) is arrived, east

    def test_zero_is_asked_for_nearer_to_the_end_than_is_required(self) -> None:
        course = PathFollower(Move(1.0), Progress(anchor=ORIGIN))
        course.look(self.moved(Pose(0.993, 0, 0)), elapsed=0.1)
        assert not course.has_arrived(stands=False, driving=DRIVING)
        assert course.has_arrived(stands=True, driving=DRIVING)

    def test_a_speed_that_was_set_is_that_of_moves_and_headings(self) -> None:
        here = self.moved(ORIGIN)
        for goal in (Move(9.0, 0.2), Head(0.0, 0.2, 9.0)):
            course = PathFollower(goal, Progress(anchor=ORIGIN))
            assert course.steer(here, driving=DRIVING, speed=1.5).forward == 1.5
            assert course.steer(here, driving=DRIVING, speed=None).forward == 0.2
        drive = PathFollower(Drive(0.2, 0.1, 9.0), Progress(anchor=ORIGIN))
        assert drive.steer(here, driving=DRIVING, speed=1.5) == Velocity(0.2, 0.1)
        assert (
            PathFollower(Wait(9.0), Progress(anchor=ORIGIN)).steer(here, driving=DRIVING, speed=1.5)
            == ZERO
        )


class TestDriven:
    def driven(self, goal: SingleGoal, rover: Rover) -> Rig:
        rig = Rig()
        rig.submit(goal)
        run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)
        return rig

    @pytest.mark.parametrize("place", [LocalPlace(2, 3), LocalPlace(-2, 1), LocalPlace(0, -2)])
    def test_to_a_place_with_a_heading_and_a_wait(self, place: LocalPlace) -> None:
        rover = Rover(Pose(0.0, 0.0, 1.0))
        rig = self.driven(GoTo(place, yaw=radians(-120), wait=2.0), rover)
        assert hypot(rover.pose.north - place.north, rover.pose.east - place.east) < 0.03
        assert rover.pose.yaw == pytest.approx(radians(-120), abs=radians(1.0))
        assert rig.task(1).progress.leg == 3

    def test_a_place_on_earth_is_found_by_the_origin(self) -> None:
        frame = Frame(ON_EARTH.latitude_degE7 - 200, ON_EARTH.longitude_degE7, 0.0)
        rover = Rover(frame=frame)
        self.driven(GoTo(ON_EARTH), rover)
        assert (rover.pose.north, rover.pose.east) == pytest.approx((2.226, 0.0), abs=0.02)

    def test_home_is_where_the_vehicle_says(self) -> None:
        frame = Frame(ON_EARTH.latitude_degE7, ON_EARTH.longitude_degE7, 0.0)
        rover = Rover(Pose(2.0, 1.0, 0.0), frame=frame)
        rover.home = ON_EARTH
        self.driven(GoTo(None), rover)
        assert (rover.pose.north, rover.pose.east) == pytest.approx((0.0, 0.0), abs=0.02)

    def test_a_place_that_cannot_be_found_yet_is_waited_for(self) -> None:
        rig, rover = Rig(), Rover()
        rig.submit(GoTo(ON_EARTH))
        rig.step(rover.view)
        assert rig.state(1) is S.QUEUED
        rover.frame = Frame(ON_EARTH.latitude_degE7, ON_EARTH.longitude_degE7 + 90, 0.0)
        run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)

    @pytest.mark.parametrize(
        ("goal", "yaw"),
        [
            (Face(radians(100)), 100),
            (Face(radians(100), -1), 100),
            (Rotate(radians(450)), 90),
        ],
    )
    def test_turning_ends_at_the_heading(self, goal: SingleGoal, yaw: float) -> None:
        rover = Rover()
        self.driven(goal, rover)
        assert rover.pose.yaw == pytest.approx(radians(yaw), abs=radians(1.0))

    def test_heading_off_turns_first_and_lasts_its_time(self) -> None:
        rover = Rover()
        rig = self.driven(Head(pi / 2, 0.5, 5.0, is_relative=True), rover)
        assert rover.pose.yaw == pytest.approx(pi / 2, abs=0.1)
        assert rover.pose.east > 0.5
        assert rig.task(1).progress.done == pytest.approx(5.2, abs=0.2)  # until it stands
