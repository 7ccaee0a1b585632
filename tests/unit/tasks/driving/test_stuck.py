"""A vehicle that is told to move and does not."""

from mav_tasks.tasks.driving.guidance import Velocity
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.stuck import BLIND, StuckWatch
from mav_tasks.tasks.goal import Move, SingleGoal
from mav_tasks.tasks.task import Pose, Progress
from tests.unit.tasks.samples import ORIGIN, motion, ours

LIMIT, TICK = 10.0, 0.05
CREEP = Velocity(0.02, 0.0)


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
