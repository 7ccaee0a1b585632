"""Tasks and views of vehicles, made by hand."""

from dataclasses import replace

from mav_tasks.kinds import Move, Pose
from mav_tasks.kinds.guidance import Motion
from mav_tasks.tasks.goal import Goal
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Draft, Marks, Submitter, Terms
from mav_tasks.tasks.view import ModeKind, VehicleView

SOMEBODY = Submitter("udpin:127.0.0.1:14560", "127.0.0.1:50000", 255, 190)
ORIGIN = Pose(0.0, 0.0, 0.0)
TASK_MOVE = 54000

FORWARD_2 = Move(2.0)


def draft(goal: Goal = FORWARD_2, *, priority: int = 5, vehicle: int = 1, nonce: int = 0) -> Draft:
    terms = Terms(priority=priority)
    return Draft(vehicle, TASK_MOVE, goal, SOMEBODY, terms, Marks(nonce))


def motion(
    pose: Pose = ORIGIN, *, at: float, forward: float = 0.0, yaw_rate: float = 0.0
) -> Motion:
    return Motion(pose, forward, 0.0, yaw_rate, at)


def idle_vehicle(*, at: float, pose: Pose = ORIGIN) -> VehicleView:
    """A rover in HOLD, disarmed, that may be armed, standing at a pose."""
    return VehicleView(
        heard=True,
        mode=ModeKind.HOLD,
        armed=False,
        may_arm=True,
        in_control=False,
        refusal=TaskReason.NONE,
        motion=motion(pose, at=at),
        still=True,
        other_controller=False,
    )


def ours(*, at: float, pose: Pose = ORIGIN, still: bool = False) -> VehicleView:
    """The same rover under our control."""
    return replace(
        idle_vehicle(at=at, pose=pose),
        mode=ModeKind.OURS,
        armed=True,
        in_control=True,
        still=still,
    )
