"""Whether a task may start, and what it waits for: pure decisions."""

from mav_tasks.settings import Watch
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.view import ModeKind, VehicleView


def start_blocker(view: VehicleView, *, watch: Watch, now: float) -> TaskReason:
    """Give why no task can take control of the vehicle now, or NONE.

    Modes are taken only from HOLD or from one that we set; from MANUAL only while disarmed.
    """
    if not view.heard:
        return TaskReason.VEHICLE_SILENT
    if view.other_controller:
        return TaskReason.OTHER_CONTROLLER
    if view.mode is ModeKind.OTHER or (view.mode is ModeKind.MANUAL and view.armed):
        return TaskReason.WRONG_MODE
    if view.motion is None or now - view.motion.at > watch.motion_fresh:
        return TaskReason.NO_POSITION
    if not view.armed and not view.may_arm:
        return TaskReason.DISARMED
    return TaskReason.NONE
