"""Where a rover stands that has been told to stop at the end: whether that is the end of it."""

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import GoTo, LocalPlace, Move, Pose
from mav_tasks.kinds.base import WAY
from mav_tasks.kinds.guidance import ZERO, Velocity
from mav_tasks.tasks.driving.arrival import Arrival
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering
from mav_tasks.tasks.task import Progress
from tests.unit.tasks.samples import ORIGIN, motion

CAR = Steering(2.0, reverses=False)


def test_a_car_that_cannot_come_back_has_one_try_and_others_correct_their_end() -> None:
    driving = Driving()
    for car, off, ends in (
        (CAR, 2.5, [True, True, True]),  # settling distances
        (None, 2.5, [False, False, False]),
        (None, 0.8, [False, False, True]),
    ):
        course = PathFollower(
            Move(10.0), Progress(anchor=ORIGIN), by_course=car is not None, steering=car
        )
        arrival, found = Arrival(), []
        for _ in ends:
            for north, speed, asked in (
                (10.0, 0.5, Velocity(0.5, 0.0)),
                (10.0 - off * driving.settle_distance, 0.0, ZERO),
            ):
                seen = motion(Pose(north, 0.0, 0.0), at=100.0, forward=speed)
                course.look(seen, elapsed=0.05)
                is_end = arrival.stands_here(
                    course, seen, asked, stands=not speed, driving=driving, now=100.0
                )
            found.append(is_end)
        assert found == ends, (car, off)


def test_who_stands_beside_its_place_drives_there_again_and_who_circles_it_does_not() -> None:
    place = LocalPlace(0.0, 3.0)
    begun = Progress(anchor=ORIGIN, leg=WAY, target=place)
    for goal, car, misses in (
        (GoTo(place), None, 1),
        (GoTo(place), CAR, 1),
        (GoTo(place, radius=3.0, turns=1.0), None, 0),
    ):
        course = PathFollower(goal, begun, steering=car)
        course.advance(motion(at=100.0))
        assert course.misses == misses, goal
    course = PathFollower(GoTo(place), begun, passing=0.5, within=0.3)
    course.look(motion(Pose(5.0, 0.0, 0.0), at=100.0), elapsed=0.05)
    assert not course.is_passing, "it went by"
    assert course.has_arrived(stands=False, driving=Driving()), "it stops and tries again"
