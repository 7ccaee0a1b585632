"""A vehicle that is told to move and does not."""

from math import pi

import pytest

from mav_tasks.tasks.driving.guidance import Velocity
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.stuck import BLIND, StuckWatch
from mav_tasks.tasks.goal import Drive, GoTo, LocalPlace, Move, Rotate, SingleGoal, Wait
from mav_tasks.tasks.task import Pose, Progress
from tests.unit.tasks.samples import ORIGIN, motion, ours

LIMIT = 10.0
TICK = 0.05


class Rig:
    """A course and its watch, at 20 Hz."""

    def __init__(self, goal: SingleGoal, progress: Progress | None = None) -> None:
        self.now = 100.0
        self.course = PathFollower(goal, progress or Progress(anchor=ORIGIN))
        self.watch = StuckWatch()
        self.watch.begin(now=self.now)

    def ticks(
        self, pose: Pose, velocity: Velocity, *, seconds: float = TICK, still: bool = False
    ) -> bool:
        """Whether it is seen to be stuck within so long."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            self.course.look(motion(pose, at=self.now), elapsed=TICK)
            seen = ours(at=self.now, pose=pose, still=still)
            if self.watch.is_stuck(self.course, seen, limit=LIMIT, now=self.now):
                return True
            self.watch.commanded(velocity, seconds=TICK)
        return False


CREEP = Velocity(0.02, 0.0)


def test_no_progress_for_the_whole_time_is_stuck() -> None:
    rig = Rig(Move(5.0))
    assert not rig.ticks(ORIGIN, CREEP, seconds=LIMIT - TICK)
    assert rig.ticks(ORIGIN, CREEP, seconds=3 * TICK)


def test_much_asked_for_in_vain_is_stuck_sooner() -> None:
    rig = Rig(Move(5.0))
    assert rig.ticks(ORIGIN, Velocity(1.0, 0.0), seconds=BLIND / 1.0 + 3 * TICK)


@pytest.mark.parametrize("step", [0.03, -0.03])
def test_any_progress_begins_the_time_anew_and_going_away_is_none(step: float) -> None:
    rig = Rig(Move(5.0))
    stuck = [rig.ticks(Pose(step * n, 0.0, 0.0), CREEP, seconds=2.0) for n in range(1, 12)]
    assert any(stuck) is (step < 0)


def test_turning_counts_in_radians() -> None:
    rig = Rig(Rotate(pi))
    for n in range(1, 12):
        assert not rig.ticks(Pose(0, 0, 0.03 * n), Velocity(0.0, 0.05), seconds=2.0)
    assert rig.ticks(Pose(0, 0, 0.36), Velocity(0.0, 1.0), seconds=BLIND + 0.3)


def test_turning_on_the_spot_towards_a_line_is_not_asked_in_vain() -> None:
    rig = Rig(Move(5.0))
    assert not rig.ticks(ORIGIN, Velocity(0.0, 0.5), seconds=LIMIT - TICK)


def test_a_velocity_for_a_time_is_stuck_only_when_it_stands() -> None:
    rig = Rig(Drive(0.3, 0.0, 60.0))
    assert not rig.ticks(ORIGIN, Velocity(0.3, 0.0), seconds=2 * LIMIT, still=False)
    assert rig.ticks(ORIGIN, Velocity(0.3, 0.0), seconds=LIMIT + 3 * TICK, still=True)


def test_waiting_is_never_stuck() -> None:
    assert not Rig(Wait(60.0)).ticks(ORIGIN, Velocity(0.0, 0.0), seconds=3 * LIMIT, still=True)
    place = LocalPlace(0.0, 0.0)
    there = Progress(anchor=ORIGIN, leg=2, target=place)
    rig = Rig(GoTo(place, wait=60.0), there)
    assert not rig.ticks(ORIGIN, Velocity(0.0, 0.0), seconds=3 * LIMIT, still=True)


def test_another_leg_begins_anew() -> None:
    rig = Rig(Move(5.0))
    for _ in range(4):
        assert not rig.ticks(ORIGIN, CREEP, seconds=LIMIT - TICK)
        rig.watch.begin(now=rig.now)
