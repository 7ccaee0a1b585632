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
NEAR = Driving().settle_distance
EACH = pytest.mark.parametrize("one_try", [True, False])


def course(one_try: bool) -> PathFollower:
    """Return a move of a car that is steered by course, or of a rover that turns on the spot."""
    progress = Progress(anchor=ORIGIN)
    if one_try:
        return PathFollower(Move(10.0), progress, by_course=True, steering=CAR)
    return PathFollower(Move(10.0), progress)


def stand_at(arrival: Arrival, way: PathFollower, north: float) -> bool:
    """Ask for zero at the end, and stand at a place; whether that is the end of it."""
    for stands, place in ((False, 10.0), (True, north)):
        seen = Motion(Pose(place, 0.0, 0.0), 0.0 if stands else 0.5, 0.0, 0.0, 100.0 + stands)
        way.look(seen, elapsed=TICK)
        last = ZERO if stands else AHEAD
        over = arrival.stands_here(way, seen, last, stands=stands, driving=Driving(), now=seen.at)
    return over


@EACH
def test_it_is_driven_no_slower_than_it_can_and_over_where_it_stands_near_enough(
    one_try: bool,
) -> None:
    slowest = Arrival().slowest(course(one_try)).speed
    assert slowest == LEAST_OF_ONE_TRY if one_try else slowest < 0.1
    assert stand_at(Arrival(), course(one_try), 10.0 - 2.5 * NEAR) is one_try


def test_others_are_corrected_before_it_is_good_enough() -> None:
    arrival, way = Arrival(), course(one_try=False)
    ends = [stand_at(arrival, way, 10.0 - 0.8 * NEAR) for _ in range(CORRECTIONS + 1)]
    assert ends == [False] * CORRECTIONS + [True]


def test_little_is_learnt_of_a_stop_from_a_crawl() -> None:
    lags = []
    for speed in (0.05, 0.5):
        creeping = Arrival().in_one_try
        before = creeping.lag
        creeping.rolled_on(2.0 * speed, speed)
        lags.append(creeping.lag - before)
    assert 0.0 < lags[0] < lags[1] / 3


@EACH
def test_it_may_be_off_to_the_side_by_its_estimate_for_longer(one_try: bool) -> None:
    watch, way = AstrayWatch(), course(one_try)
    watch.commanded(AHEAD)
    found = next(
        0.025 * step
        for step in range(1, 100)
        if watch.is_astray(
            way, Motion(Pose(0.0, 0.025 * step, 0.0), 0.0, 0.5, 0.0, 100.0 + TICK * step)
        )
    )
    most = min(WRONG_WAY_OF_ONE_TRY, 1.0) if one_try else WRONG_WAY
    assert found == pytest.approx(most, abs=0.1)


@EACH
def test_it_is_not_stuck_while_its_estimate_goes_anywhere(one_try: bool) -> None:
    watch, way, found = StuckWatch(), course(one_try), False
    watch.begin(now=100.0)
    for step in range(160):  # 8 s, in which it is asked for 4 m and its estimate leaps about
        now = 100.0 + TICK * (step + 1)
        pose = Pose(-0.03 * (step % 2), 0.0, 0.0)
        way.look(motion(pose, at=now), elapsed=TICK)
        seen = ours(at=now, pose=pose, still=False)
        found = found or watch.is_stuck(way, seen, limit=10.0, now=now)
        watch.commanded(AHEAD, seconds=TICK)
    assert found is not one_try


def test_it_goes_on_beside_its_line_rather_than_drive_a_circle() -> None:
    progress = Progress(anchor=ORIGIN, done=3.0)
    for beside, goes_on in ((0.4, True), (1.2, False)):
        here = motion(Pose(3.0, beside, 0.05), at=100.0)
        way = recovery_path(Move(10.0), progress, here, honours_yaw_rate=False, steering=CAR)
        assert (way is None) is goes_on, beside
