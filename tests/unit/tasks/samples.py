"""Who submits, and motions of vehicles, made by hand."""

from mav_tasks.kinds import Move, Pose
from mav_tasks.kinds.guidance import Motion
from mav_tasks.tasks.task import Submitter

SOMEBODY = Submitter("udpin:127.0.0.1:14560", "127.0.0.1:50000", 255, 190)
ORIGIN = Pose(0.0, 0.0, 0.0)
TASK_MOVE = 54000

FORWARD_2 = Move(2.0)


def motion(
    pose: Pose = ORIGIN, *, at: float, forward: float = 0.0, yaw_rate: float = 0.0
) -> Motion:
    return Motion(pose, forward, 0.0, yaw_rate, at)
