"""A car that is steered by course drives to its end in one try: it would come back in a loop."""

import pytest

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.arrival import CORRECTIONS, LEAST_OF_ONE_TRY, Arrival
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity
from mav_tasks.tasks.driving.path_divergence import WRONG_WAY, WRONG_WAY_OF_ONE_TRY, AstrayWatch
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.planner import Steering
from mav_tasks.tasks.driving.recovery_path import recovery_path
from mav_tasks.tasks.driving.stuck import StuckWatch
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.task import Pose, Progress
from tests.unit.tasks.samples import ORIGIN, motion, ours

TICK = 0.05
CAR = Steering(2.0, reverses=False)
AHEAD = Velocity(0.5, 0.0)


def course(*, one_try: bool, length: float = 10.0) -> PathFollower:
    """Return a move of a car that is steered by course, or of a rover that turns on the spot."""
    progress = Progress(anchor=ORIGIN)
    if one_try:
        return PathFollower(Move(length), progress, by_course=True, steering=CAR)
    return PathFollower(Move(length), progress)


def stand_at(arrival: Arrival, way: PathFollower, north: float) -> bool:
    """Ask for zero at the end, and stand at a place; whether that is the end of it."""
    seen = Motion(Pose(10.0, 0.0, 0.0), 0.5, 0.0, 0.0, 100.0)
    way.look(seen, elapsed=TICK)
    assert arrival.stands_here(way, seen, AHEAD, stands=False, driving=Driving(), now=100.0)
    seen = Motion(Pose(north, 0.0, 0.0), 0.0, 0.0, 0.0, 101.0)
    way.look(seen, elapsed=TICK)
    return arrival.stands_here(way, seen, ZERO, stands=True, driving=Driving(), now=101.0)


class TestArrival:
    def test_is_driven_at_no_less_than_half_a_metre_a_second(self) -> None:
        assert Arrival().slowest(course(one_try=True)).speed == LEAST_OF_ONE_TRY
        assert Arrival().slowest(course(one_try=False)).speed < 0.1

    def test_is_over_where_it_stands_within_three_settling_distances(self) -> None:
        near = Driving().settle_distance
        for one_try in (True, False):
            arrival, way = Arrival(), course(one_try=one_try)
            assert stand_at(arrival, way, 10.0 - 2.5 * near) is one_try

    def test_of_others_is_corrected_before_it_is_good_enough(self) -> None:
        arrival, way = Arrival(), course(one_try=False)
        near = 10.0 - 0.8 * Driving().settle_distance
        ends = [stand_at(arrival, way, near) for _ in range(CORRECTIONS + 1)]
        assert ends == [False] * CORRECTIONS + [True]

    def test_learns_little_of_a_stop_from_a_crawl(self) -> None:
        lags = []
        for speed in (0.05, 0.5):
            creeping = Arrival().in_one_try
            before = creeping.lag
            creeping.rolled_on(2.0 * speed, speed)
            lags.append(creeping.lag - before)
        assert 0.0 < lags[0] < lags[1] / 3


@pytest.mark.parametrize(("one_try", "most"), [(True, WRONG_WAY_OF_ONE_TRY), (False, WRONG_WAY)])
def test_may_be_off_to_the_side_by_its_estimate_for_longer(one_try: bool, most: float) -> None:
    watch, way, found = AstrayWatch(), course(one_try=one_try), None
    watch.commanded(AHEAD)
    for step in range(1, 100):
        pose = Pose(0.0, 0.5 * TICK * step, 0.0)
        if watch.is_astray(way, Motion(pose, 0.0, 0.5, 0.0, 100.0 + TICK * step)):
            found = 0.5 * TICK * step
            break
    assert found == pytest.approx(min(most, 1.0 if one_try else most), abs=0.1)


@pytest.mark.parametrize("one_try", [True, False])
def test_is_not_stuck_while_its_estimate_goes_anywhere(one_try: bool) -> None:
    watch, way, now, found = StuckWatch(), course(one_try=one_try), 100.0, False
    watch.begin(now=now)
    for step in range(160):  # 8 s, in which it is asked for 4 m and its estimate leaps about
        now += TICK
        pose = Pose(-0.03 * (step % 2), 0.0, 0.0)
        way.look(motion(pose, at=now), elapsed=TICK)
        seen = ours(at=now, pose=pose, still=False)
        found = found or watch.is_stuck(way, seen, limit=10.0, now=now)
        watch.commanded(AHEAD, seconds=TICK)
    assert found is not one_try


@pytest.mark.parametrize(("beside", "goes_on"), [(0.4, True), (1.2, False)])
def test_goes_on_beside_its_line_rather_than_drive_a_circle(beside: float, goes_on: bool) -> None:
    progress = Progress(anchor=ORIGIN, done=3.0)
    here = motion(Pose(3.0, beside, 0.05), at=100.0)
    way = recovery_path(Move(10.0), progress, here, honours_yaw_rate=False, steering=CAR)
    assert (way is None) is goes_on
