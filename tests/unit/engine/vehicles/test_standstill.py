"""Standing still is decided by displacement, against what this rover does at rest."""

from collections.abc import Iterator
from math import exp, sqrt
from random import Random

import pytest

from mav_tasks.engine.vehicles.standstill import LEAST_WAY, MOST_WAY, Standstill
from mav_tasks.settings import Watch
from mav_tasks.tasks.driving.guidance import Motion
from mav_tasks.tasks.task import Pose

WATCH = Watch()
PERIOD = 0.05  # s


def wandering(random: Random, *, sigma: float, seconds: float) -> Iterator[float]:
    """Yield an offset that wanders: sigma its spread, seconds its correlation time."""
    keep = exp(-PERIOD / seconds)
    value = random.gauss(0.0, sigma)
    while True:
        yield value
        value = keep * value + sqrt(1 - keep * keep) * random.gauss(0.0, sigma)


def motion(at: float, *, north: float, speed: float, east: float = 0.0, yaw: float = 0.0) -> Motion:
    return Motion(Pose(north, east, yaw), speed, 0.0, 0.0, at)


def fed(
    made: Standstill,
    *,
    seconds: float,
    true_speed: float = 0.0,
    offset: float = 0.03,
    wander: float = 0.0,
    begins: float = 0.0,
    seed: int = 0,
) -> float:
    """Let it see a rover for so long; gives the time at the end."""
    random = Random(seed)
    north, east = (wandering(random, sigma=wander, seconds=2.0) for _ in "NE")
    now = begins
    for number in range(round(seconds / PERIOD)):
        now = begins + number * PERIOD
        along = true_speed * number * PERIOD
        made.receive(
            motion(now, north=along + next(north), east=next(east), speed=true_speed + offset),
            now=now,
        )
    return now


@pytest.mark.parametrize("offset", [0.0, 0.025, 0.036, 0.07])
def test_a_rover_that_reports_a_speed_at_rest_stands_after_a_second(offset: float) -> None:
    made = Standstill()
    assert not made.has_stood(WATCH, now=fed(made, seconds=0.8, offset=offset))
    assert made.has_stood(WATCH, now=fed(made, seconds=1.3, offset=offset, begins=0.8))


@pytest.mark.parametrize("true_speed", [0.05, 0.1, 0.5])
def test_one_that_creeps_does_not_stand_whatever_it_reports(true_speed: float) -> None:
    made = Standstill()
    now = fed(made, seconds=3.0, true_speed=true_speed, offset=-true_speed)
    assert not made.has_stood(WATCH, now=now)
    assert not made.confirms(WATCH, now=now)


def test_one_that_turns_on_the_spot_does_not_stand() -> None:
    made, now = Standstill(), 0.0
    for number in range(60):
        now = number * PERIOD
        made.receive(motion(now, north=0.0, speed=0.0, yaw=0.1 * now), now=now)
    assert not made.has_stood(WATCH, now=now)


def test_what_a_noisy_rover_does_at_rest_is_learnt_and_no_less_is_believed() -> None:
    """With metre-class GPS a standing rover seems to get 0.05 to 0.2 m on in a second."""
    made = Standstill()
    made.told_to_stand(now=0.0)
    fed(made, seconds=20.0, offset=0.3, wander=0.08)
    assert LEAST_WAY < made.least_way <= MOST_WAY
    seen = 0
    for seed in range(20):
        begins = 20.0 + 5.0 * seed
        now = fed(made, seconds=5.0, offset=0.3, wander=0.08, begins=begins, seed=seed)
        seen += made.has_stood(WATCH, now=now)
    assert seen >= 18
    now = fed(made, seconds=3.0, true_speed=0.5, offset=0.0, wander=0.08, begins=130.0)
    assert not made.has_stood(WATCH, now=now)


def test_nothing_is_learnt_of_one_that_may_be_moving() -> None:
    made = Standstill()
    made.told_to_stand(now=0.0)
    made.may_move()
    fed(made, seconds=20.0, offset=0.3, wander=0.08)
    assert made.least_way == LEAST_WAY


def test_nothing_is_learnt_of_one_that_rolls() -> None:
    made = Standstill()
    made.told_to_stand(now=0.0)
    fed(made, seconds=20.0, true_speed=0.2)
    assert made.least_way == LEAST_WAY


def test_speed_is_displacement_over_time() -> None:
    made = Standstill()
    now = fed(made, seconds=3.0, true_speed=0.4, offset=0.5)
    assert made.speed(1.0, now=now) == pytest.approx(0.4, abs=0.01)
    assert made.speed(30.0, now=now) is None
