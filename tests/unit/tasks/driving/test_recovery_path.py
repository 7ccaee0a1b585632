"""From wherever an interruption left the vehicle, back to where the task can go on."""

from math import copysign, cos, hypot, pi, radians, sin

import pytest

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import Motion, cross_track, wrap
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.recovery_path import (
    OFF_TRACK,
    ON_SPOT,
    PAST_END,
    is_off_line,
    recovery_path,
    resumed,
)
from mav_tasks.tasks.goal import Drive, GoTo, LocalPlace, Move, Rotate, SingleGoal, Wait
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Pose, Progress, Task
from tests.unit.tasks.samples import draft, motion

ANCHOR = Pose(10.0, 20.0, radians(30))
DRIVING = Driving()
TICK = 0.05


def go_on(goal: SingleGoal, progress: Progress, pose: Pose) -> Progress:
    return resumed(goal, progress, motion(pose, at=0.0), turns_first=True)


def beside(along: float, across: float, *, turned: float = 0.0) -> Pose:
    """A pose by its metres along the anchor's heading and to the right of it."""
    forward, right = (cos(ANCHOR.yaw), sin(ANCHOR.yaw)), (-sin(ANCHOR.yaw), cos(ANCHOR.yaw))
    return Pose(
        ANCHOR.north + along * forward[0] + across * right[0],
        ANCHOR.east + along * forward[1] + across * right[1],
        wrap(ANCHOR.yaw + turned),
    )


def back(goal: SingleGoal, done: float, pose: Pose) -> PathFollower | None:
    return recovery_path(
        goal, Progress(anchor=ANCHOR, done=done), motion(pose, at=0.0), honours_yaw_rate=True
    )


def driven(course: PathFollower, pose: Pose) -> Pose:
    """Where a point ends that follows a course exactly."""
    for _ in range(4000):
        seen = Motion(pose, 0.0, 0.0, 0.0, 0.0)
        course.look(seen, elapsed=TICK)
        if course.has_arrived(stands=True, driving=DRIVING):
            if not course.advance(seen):
                return pose
            continue
        wish = course.steer(seen, driving=DRIVING, speed=None)
        middle = pose.yaw + wish.yaw_rate * TICK / 2
        pose = Pose(
            pose.north + wish.forward * TICK * cos(middle),
            pose.east + wish.forward * TICK * sin(middle),
            wrap(pose.yaw + wish.yaw_rate * TICK),
        )
    raise AssertionError(f"no end of {course} at {pose}")


def apart(one: Pose, other: Pose) -> float:
    return hypot(one.north - other.north, one.east - other.east)


class TestNothingToDo:
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize("along", [0.0, 3.0, 3.5, 1.0, 9.99])
    def test_on_the_line_of_a_move(self, sign: float, along: float) -> None:
        assert back(Move(sign * 10.0), 3.0, beside(sign * along, 0.0)) is None

    @pytest.mark.parametrize("across", [0.9, -0.9, ON_SPOT / 2])
    def test_where_steering_comes_back_by_itself(self, across: float) -> None:
        assert back(Move(10.0), 3.0, beside(3.0, across)) is None

    @pytest.mark.parametrize("turned", [0.0, radians(29), radians(-29)])
    def test_at_the_spot_of_a_rotation(self, turned: float) -> None:
        assert back(Rotate(-2.0), 1.0, beside(0.0, 0.01, turned=-1.0 + turned)) is None

    @pytest.mark.parametrize("goal", [Drive(0.5, 0.1, 9.0), Wait(9.0)])
    def test_for_what_promises_a_time_only(self, goal: SingleGoal) -> None:
        assert back(goal, 3.0, beside(7.0, -8.0, turned=2.0)) is None


class TestAMove:
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize("bearing_deg", range(0, 360, 45))
    def test_displaced_anywhere_goes_back_to_where_it_was(
        self, sign: float, bearing_deg: int
    ) -> None:
        goal, done = Move(sign * 10.0), 3.0
        angle = radians(bearing_deg)
        pose = beside(sign * done + 12.0 * cos(angle), 12.0 * sin(angle), turned=angle)
        course = back(goal, done, pose)
        assert course is not None
        end = driven(course, pose)
        assert apart(end, beside(sign * done, 0.0)) < 0.03
        assert abs(wrap(end.yaw - ANCHOR.yaw)) < radians(1.0)

    def test_a_little_off_near_its_end_goes_onto_the_line_there(self) -> None:
        pose = beside(9.0, 0.5)
        course = back(Move(10.0), 9.0, pose)
        assert course is not None
        assert apart(driven(course, pose), beside(9.0, 0.0)) < 0.03

    def test_past_its_end_goes_back(self) -> None:
        assert back(Move(10.0), 3.0, beside(10.0 + PAST_END / 2, 0.0)) is None
        pose = beside(10.0 + 2 * PAST_END, 0.0)
        course = back(Move(10.0), 9.5, pose)
        assert course is not None
        assert apart(driven(course, pose), beside(9.5, 0.0)) < 0.03

    def test_turned_on_its_line_it_turns_back_before_it_drives(self) -> None:
        pose = beside(3.0, 0.0, turned=radians(90))
        course = back(Move(10.0), 3.0, pose)
        assert course is not None
        end = driven(course, pose)
        assert apart(end, pose) < 0.03
        assert abs(wrap(end.yaw - ANCHOR.yaw)) < radians(1.0)


class TestARotation:
    @pytest.mark.parametrize("angle", [pi, -pi, radians(700)])
    @pytest.mark.parametrize(("along", "across"), [(3.0, 0.0), (-3.0, 0.0), (0.0, 3.0), (2, -2)])
    def test_displaced_anywhere_goes_back_to_its_spot_and_heading(
        self, angle: float, along: float, across: float
    ) -> None:
        done = 2.0
        pose = beside(along, across, turned=1.0)
        course = back(Rotate(angle), done, pose)
        assert course is not None
        end = driven(course, pose)
        assert apart(end, ANCHOR) < 0.03
        assert abs(wrap(end.yaw - ANCHOR.yaw - copysign(done, angle))) < radians(1.0)

    def test_turned_by_much_on_its_spot_turns_back(self) -> None:
        assert back(Rotate(pi), 1.0, beside(0.0, 0.0, turned=1.0 + radians(31))) is not None


def task_of(goal: SingleGoal, progress: Progress) -> Task:
    registry = TaskRegistry()
    task = registry.submit(draft(goal), now=0.0)
    registry.note_progress(task.id, progress)
    return registry[task.id]


class TestOffLine:
    @pytest.mark.parametrize(
        ("goal", "pose", "is_off"),
        [
            (Move(10.0), beside(5.0, OFF_TRACK - 0.01), False),
            (Move(10.0), beside(5.0, OFF_TRACK + 0.01), True),
            (Move(10.0), beside(5.0, -OFF_TRACK - 0.01), True),
            (Move(10.0), beside(10.0 + PAST_END - 0.01, 0.0), False),
            (Move(10.0), beside(10.0 + PAST_END + 0.01, 0.0), True),
            (Move(10.0), beside(-OFF_TRACK - 0.01, 0.0), True),
            (Move(-10.0), beside(-5.0, 0.5), False),
            (Move(-10.0), beside(OFF_TRACK + 0.01, 0.0), True),
            (Rotate(1.0), beside(0.0, OFF_TRACK - 0.01, turned=3.0), False),
            (Rotate(1.0), beside(0.0, OFF_TRACK + 0.01), True),
            (Drive(0.5, 0.0, 5.0), beside(9.0, 9.0), False),
        ],
    )
    def test_is_further_than_a_metre_or_past_the_end(
        self, goal: SingleGoal, pose: Pose, is_off: bool
    ) -> None:
        assert is_off_line(task_of(goal, Progress(anchor=ANCHOR, done=4.0)), pose) is is_off

    def test_is_never_what_has_not_begun(self) -> None:
        assert not is_off_line(task_of(Move(1.0), Progress()), Pose(99.0, 99.0, 0.0))


class TestAWay:
    TARGET = LocalPlace(5.0, 0.0)
    GOAL = GoTo(TARGET, yaw=1.0, wait=3.0)

    def progress(self, leg: int, anchor: Pose, done: float = 0.0) -> Progress:
        return Progress(anchor=anchor, leg=leg, done=done, target=self.TARGET)

    def test_near_its_line_goes_on(self) -> None:
        progress = self.progress(1, Pose(0.0, 0.0, 0.0), 2.0)
        assert go_on(self.GOAL, progress, Pose(2.0, 0.9, 1.0)) == progress

    @pytest.mark.parametrize("pose", [Pose(2.0, 1.1, 0.0), Pose(-0.1, 0.0, 0.0), Pose(5.1, 0, 0)])
    def test_off_its_line_it_is_begun_again_from_here_with_the_same_place(self, pose: Pose) -> None:
        progress = self.progress(1, Pose(0.0, 0.0, 0.0), 2.0)
        again = go_on(self.GOAL, progress, pose)
        assert (again.leg, again.done, again.anchor, again.target) == (0, 0.0, pose, self.TARGET)

    def test_at_the_place_the_wait_goes_on_and_away_from_it_the_way_is_driven_again(self) -> None:
        progress = self.progress(3, Pose(5.0, 0.0, 1.0), 2.0)
        assert go_on(self.GOAL, progress, Pose(5.03, 0.0, 1.0)) == progress
        assert go_on(self.GOAL, progress, Pose(5.1, 0.0, 1.0)).leg == 0

    def test_off_the_place_by_less_than_its_radius_is_there(self) -> None:
        goal = GoTo(self.TARGET, radius=0.5, wait=3.0)
        progress = self.progress(2, Pose(4.6, 0.0, 0.0), 2.0)
        assert go_on(goal, progress, Pose(4.6, 0.0, 1.0)) == progress

    def test_its_line_is_what_a_takeover_is_measured_by(self) -> None:
        progress = self.progress(1, Pose(0.0, 0.0, 0.0), 2.0)
        assert cross_track(Pose(0.0, 0.0, 0.0), Pose(2.0, 1.1, 0.0)) > OFF_TRACK
        assert is_off_line(task_of(self.GOAL, progress), Pose(2.0, 1.1, 0.0))
