import re

import pytest

from mav_tasks.agents.limits import Limits
from mav_tasks.client.values import VehicleStatus
from mav_tasks.client.wire import Goal
from mav_tasks.errors import UsageError
from mav_tasks.tasks.goal import Drive, Face, GlobalPlace, GoTo, LocalPlace, Move, Rotate, Wait

ROVER = VehicleStatus(
    1,
    "px4",
    False,
    "HOLD",
    True,
    191,
    north=10.0,
    east=0.0,
    latitude=47.0,
    longitude=8.0,
)
UNKNOWN = VehicleStatus(1, "px4", False, "HOLD", True, 191)


@pytest.mark.parametrize(
    ("goals", "metres"),
    [
        ([Move(3.0)], 3.0),
        ([Move(-3.0), Move(3.0)], 6.0),
        ([Drive(-0.5, 0.1, 4.0)], 2.0),
        ([GoTo(LocalPlace(13.0, 4.0))], 5.0),
        ([GoTo(LocalPlace(13.0, 4.0)), GoTo(LocalPlace(10.0, 0.0))], 10.0),
        ([GoTo(GlobalPlace(470_000_898, 80_000_000))], 10.0),  # 89.8e-6 deg
        # after a move the rover may be anywhere 2 m around
        ([Move(2.0), GoTo(LocalPlace(10.0, 3.0))], 7.0),
    ],
)
def test_the_distance_is_that_of_the_whole_task(goals: list[Goal], metres: float) -> None:
    Limits(max_distance=metres + 0.01).check_distance(goals, rover=ROVER)
    limit = metres - 0.01
    words = f"--max-distance {limit:g} m: this task may drive {metres:.1f} m"
    with pytest.raises(UsageError, match=re.escape(words)):
        Limits(max_distance=limit).check_distance(goals, rover=ROVER)


def test_what_does_not_drive_has_no_distance() -> None:
    goals: list[Goal] = [Rotate(1.0), Wait(5.0), Face(1.0)]
    Limits(max_distance=0.0).check_distance(goals, rover=UNKNOWN)


@pytest.mark.parametrize(
    ("goal", "rover", "what"),
    [
        (GoTo(None), ROVER, "the rover's home is not known here"),
        (GoTo(LocalPlace(0.0, 0.0)), UNKNOWN, "the rover's position is not known here"),
        (GoTo(GlobalPlace(0, 0)), UNKNOWN, "the rover's position is not known here"),
    ],
)
def test_a_distance_that_nobody_can_know_is_refused(
    goal: Goal, rover: VehicleStatus, what: str
) -> None:
    with pytest.raises(UsageError, match=f"--max-distance cannot be checked: {what}"):
        Limits(max_distance=1e6).check_distance([goal], rover=rover)
    Limits().check_distance([goal], rover=rover)


@pytest.mark.parametrize("goal", [Move(1.0), Move(1.0, 0.0), GoTo(None), GoTo(None, speed=0.0)])
def test_with_a_limit_a_speed_must_be_named(goal: Goal) -> None:
    with pytest.raises(UsageError, match=r"--max-speed 0\.5 m/s: name the speed"):
        Limits(max_speed=0.5).check_speed([Wait(1.0), goal])
    Limits().check_speed([goal])


def test_a_speed_above_the_limit_is_refused() -> None:
    limits = Limits(max_speed=0.5)
    limits.check_speed([Move(1.0, 0.5), Drive(-0.5, 0.0, 1.0), GoTo(None, speed=0.1), Rotate(1.0)])
    for goal in (Move(1.0, 0.6), Drive(-0.6, 0.0, 1.0), GoTo(None, speed=0.6)):
        with pytest.raises(UsageError, match=r"--max-speed 0\.5 m/s: a goal asks for -?0\.6 m/s"):
            limits.check_speed([goal])


def test_a_full_queue_takes_no_further_task() -> None:
    Limits(max_queued=2).check_queue(1)
    with pytest.raises(UsageError, match="--max-queued 2: the rover has 2 tasks"):
        Limits(max_queued=2).check_queue(2)
    Limits().check_queue(1000)


def test_agents_are_told_of_the_limits() -> None:
    assert Limits().words() == ""
    words = Limits(max_distance=20.0, max_queued=3).words()
    assert words == "Limits here: 20 m of driving in one task; 3 tasks of a rover at a time."
