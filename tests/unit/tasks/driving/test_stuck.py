"""A vehicle that is told to move and does not."""

from math import pi

from mav_tasks.kinds import Drive, GoTo, LocalPlace, Move, Pose, Rotate, SingleGoal, Wait
from mav_tasks.kinds.guidance import ZERO, Velocity
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.watches import BLIND, StuckWatch
from mav_tasks.tasks.task import Progress
from tests.unit.tasks.samples import ORIGIN, motion, ours

LIMIT, TICK = 10.0, 0.05
CREEP = Velocity(0.02, 0.0)
TURN = Velocity(0.0, 0.05)


class Rig:
    """A course and its watch, at 20 Hz."""

    def __init__(self, goal: SingleGoal, progress: Progress | None = None) -> None:
        self.now = 100.0
        self.course = PathFollower(goal, progress or Progress(anchor=ORIGIN))
        self.watch = StuckWatch()
        self.watch.begin(now=self.now)

    def is_stuck(
        self, velocity: Velocity, seconds: float, pose: Pose = ORIGIN, *, still: bool = False
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


def test_no_progress_for_the_whole_time_or_much_asked_for_in_vain_is_stuck() -> None:
    rig = Rig(Move(5.0))
    for _ in range(4):  # another leg begins anew
        assert not rig.is_stuck(CREEP, LIMIT - TICK)
        rig.watch.begin(now=rig.now)
    assert not rig.is_stuck(CREEP, LIMIT - TICK)
    assert rig.is_stuck(CREEP, 3 * TICK)
    assert Rig(Move(5.0)).is_stuck(Velocity(1.0, 0.0), BLIND / 1.0 + 3 * TICK)


def test_any_progress_begins_the_time_anew_and_going_away_is_none() -> None:
    for step in (0.03, -0.03):
        rig = Rig(Move(5.0))
        stuck = [rig.is_stuck(CREEP, 2.0, Pose(step * n, 0.0, 0.0)) for n in range(1, 12)]
        assert any(stuck) is (step < 0)


def test_turning_counts_in_radians_and_towards_a_line_is_not_asked_in_vain() -> None:
    rig = Rig(Rotate(pi))
    assert not any(rig.is_stuck(TURN, 2.0, Pose(0, 0, 0.03 * n)) for n in range(1, 12))
    assert rig.is_stuck(Velocity(0.0, 1.0), BLIND + 0.3, Pose(0, 0, 0.36))
    assert not Rig(Move(5.0)).is_stuck(Velocity(0.0, 0.5), LIMIT - TICK)


def test_a_velocity_for_a_time_is_stuck_only_when_it_stands_and_waiting_never() -> None:
    rig = Rig(Drive(0.3, 0.0, 60.0))
    assert not rig.is_stuck(Velocity(0.3, 0.0), 2 * LIMIT)
    assert rig.is_stuck(Velocity(0.3, 0.0), LIMIT + 3 * TICK, still=True)
    place = LocalPlace(0.0, 0.0)
    there = Progress(anchor=ORIGIN, leg=2, target=place)
    for rig in (Rig(Wait(60.0)), Rig(GoTo(place, wait=60.0), there)):
        assert not rig.is_stuck(ZERO, 3 * LIMIT, still=True)
