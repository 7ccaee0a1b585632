"""From wherever an interruption left the vehicle, back to where the task can go on."""

from dataclasses import replace
from math import copysign, cos, hypot, pi, radians, sin
from typing import Any

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import Bend, Drive, GoTo, LocalPlace, Move, Pose, Rotate, SingleGoal, Wait
from mav_tasks.kinds.base import OFF_TRACK, ON_SPOT, PAST_END
from mav_tasks.kinds.guidance import Motion
from mav_tasks.kinds.path import wrap
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering
from mav_tasks.tasks.driving.stage import is_off_line, recovery_path, resumed, was_handled
from mav_tasks.tasks.task import Marks, Progress, Task, TaskId
from tests.unit.tasks.samples import SOMEBODY, TASK_MOVE, motion

ANCHOR = Pose(10.0, 20.0, radians(30))
NORTHWARDS = Pose(0.0, 0.0, 0.0)
TICK = 0.05
#: along and across the line, and turned from it; past its end, or off it
OVER, OFF = PAST_END + 0.01, OFF_TRACK + 0.01
TARGET = LocalPlace(5.0, 0.0)
WAY = GoTo(TARGET, yaw=1.0, wait=3.0)


def beside(along: float, across: float, turned: float = 0.0) -> Pose:
    """A pose by its metres along the anchor's heading and to the right of it."""
    forward, right = (cos(ANCHOR.yaw), sin(ANCHOR.yaw)), (-sin(ANCHOR.yaw), cos(ANCHOR.yaw))
    return Pose(
        ANCHOR.north + along * forward[0] + across * right[0],
        ANCHOR.east + along * forward[1] + across * right[1],
        wrap(ANCHOR.yaw + turned),
    )


def back(goal: SingleGoal, done: float, pose: Pose) -> PathFollower | None:
    progress = Progress(anchor=ANCHOR, done=done)
    return recovery_path(goal, progress, motion(pose, at=0.0), honours_yaw_rate=True)


def task_of(goal: SingleGoal, progress: Progress) -> Task:
    return Task(TaskId(1), 1, TASK_MOVE, goal, SOMEBODY, Marks(), 0.0, progress=progress)


def is_led(goal: SingleGoal, done: float, pose: Pose, end: Pose) -> bool:
    """Whether a point that follows the way back exactly ends there, and as the goal was."""
    course = back(goal, done, pose)
    assert course is not None, (goal, pose)
    for _ in range(4000):
        seen = Motion(pose, 0.0, 0.0, 0.0, 0.0)
        course.look(seen, elapsed=TICK)
        if not course.has_arrived(stands=True, driving=Driving()):
            wish = course.steer(seen, driving=Driving(), speed=None)
            middle = pose.yaw + wish.yaw_rate * TICK / 2
            pose = Pose(
                pose.north + wish.forward * TICK * cos(middle),
                pose.east + wish.forward * TICK * sin(middle),
                wrap(pose.yaw + wish.yaw_rate * TICK),
            )
        elif not course.advance(seen):
            apart = hypot(pose.north - end.north, pose.east - end.east)
            return apart < 0.03 and abs(wrap(pose.yaw - end.yaw)) < radians(1.0)
    return False


GOALS: dict[str, Any] = {kind.__name__: kind for kind in (Move, Rotate, Drive, Wait)}


def goal_of(text: str) -> SingleGoal:
    name, *values = text.split()
    return GOALS[name](*numbers(*values))  # type: ignore[no-any-return]


def numbers(*words: str) -> list[float]:
    """Return numbers; "near" and "far" are a bit less and more than the limits."""
    known = {"near": OFF_TRACK - 0.01, "far": OFF, "-far": -OFF}
    return [known[word] if word in known else float(word) for word in words]


def test_there_is_no_way_back_where_it_goes_on_by_itself() -> None:
    tilt, spot, end = radians(29), ON_SPOT / 2, 10.0 + PAST_END / 2
    for row in f"""Move 10: 3: 0 0, 3 0, 3.5 0, 1 0, 9.99 0, 3 0.9, 3 -0.9, 3 {spot}, {end} 0
        Move -10: 3: -3.5 0
        Rotate -2: 1: 0 0.01 -1, 0 0.01 {tilt - 1}, 0 0.01 {-tilt - 1}
        Drive 0.5 0.1 9: 3: 7 -8 2
        Wait 9: 3: 7 -8 2""".splitlines():  # the last two promise a time only
        goal, done, places = row.split(":")
        for place in places.split(","):
            found = back(goal_of(goal), float(done), beside(*numbers(*place.split())))
            assert found is None, (goal, place)
    assert back(Rotate(pi), 1.0, beside(0.0, 0.0, 1.0 + radians(31))) is not None


@settings(max_examples=30)
@given(st.sampled_from([1.0, -1.0]), st.floats(-pi, pi), st.floats(1.5, 12.0))
def test_a_move_displaced_anywhere_goes_back_to_where_it_was(
    sign: float, angle: float, by: float
) -> None:
    pose = beside(sign * 3.0 + by * cos(angle), by * sin(angle), angle)
    assume(abs(by * sin(angle)) > OFF_TRACK)  # else it comes back to its line by itself
    assert is_led(Move(sign * 10.0), 3.0, pose, beside(sign * 3.0, 0.0))


def test_a_rotation_displaced_anywhere_goes_back_to_its_spot_and_heading() -> None:
    for angle in (pi, -pi, radians(700)):
        end = beside(0.0, 0.0, copysign(2.0, angle))
        for along, across in ((3.0, 0.0), (-3.0, 0.0), (0.0, 3.0), (2, -2)):
            assert is_led(Rotate(angle), 2.0, beside(along, across, 1.0), end)


def test_off_its_line_is_further_than_a_metre_or_past_the_end() -> None:
    begun = Progress(anchor=ANCHOR, done=4.0)
    on_way = Progress(anchor=NORTHWARDS, leg=1, done=2.0, target=TARGET)
    in_bend = replace(on_way, path=(Bend(0.5, 6.0),))
    for progress, north, was in (
        (in_bend, 9.0, False),
        (Progress(), 0.01, False),
        (Progress(), 9, True),
    ):
        assert was_handled(task_of(WAY, progress), NORTHWARDS, Pose(north, 0.0, 0.0)) is was
    car = Steering(2.0, reverses=False)
    for pose in (Pose(1.68, 0.92, 1.0), Pose(-9.0, 0.0, 0.0)):
        found = resumed(WAY, in_bend, motion(pose, at=0.0), turns_first=False, steering=car)
        assert (found == in_bend) is (pose.yaw == 1.0), pose
    aside = motion(beside(4.0, 5.0), at=0.0)
    assert recovery_path(Move(9.0), begun, aside, honours_yaw_rate=True, steering=car)
    for row in f"""Move 10: on it: 5 near
        Move 10: off it: 5 far
        Move 10: off it: 5 -far
        Move 10: on it: {10.0 + PAST_END - 0.01} 0
        Move 10: off it: {10.0 + OVER} 0
        Move 10: off it: -far 0
        Move -10: on it: -5 0.5
        Move -10: off it: far 0
        Rotate 1: on it: 0 near 3
        Rotate 1: off it: 0 far
        Drive 0.5 0 5: on it: 9 9""".splitlines():
        text, where, place = row.split(":")
        task = task_of(goal_of(text), begun)
        assert is_off_line(task, beside(*numbers(*place.split()))) is ("off" in where), row
    for goal, progress, pose, is_off in (
        (Move(1.0), Progress(), Pose(99.0, 99.0, 0.0), False),  # it has not begun
        (WAY, on_way, Pose(2.0, 1.1, 0.0), True),
        (WAY, in_bend, Pose(2.0, 2.0, 0.0), False),
        (WAY, in_bend, Pose(9.0, 9.0, 0.0), True),
    ):
        assert is_off_line(task_of(goal, progress), pose) is is_off, (goal, pose)


def test_a_way_goes_on_near_its_line_or_place_and_is_else_begun_again_from_here() -> None:
    near = GoTo(TARGET, radius=0.5, wait=3.0)
    for row in """1: 0 0 0: 2 0.9 1: goes on
        1: 0 0 0: 2 1.1 0: begins again
        1: 0 0 0: -0.1 0 0: begins again
        1: 0 0 0: 5.1 0 0: begins again
        3: 5 0 1: 5.03 0 1: goes on
        3: 5 0 1: 5.1 0 1: begins again
        2: 4.6 0 0: 4.6 0 1: goes on""".splitlines():  # 3: the wait at the place
        leg, *poses, then = row.split(":")
        anchor, pose = (Pose(*numbers(*each.split())) for each in poses)
        progress = Progress(anchor=anchor, leg=int(leg), done=2.0, target=TARGET)
        goal = near if progress.leg == 2 else WAY
        again = resumed(goal, progress, motion(pose, at=0.0), turns_first=True)
        if "goes on" in then:
            assert again == progress, (leg, pose)
        else:
            found = again.leg, again.done, again.anchor, again.target
            assert found == (0, 0.0, pose, TARGET), (leg, pose)
