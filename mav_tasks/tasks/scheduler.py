"""Scheduling decisions as pure functions: what blocks a start, and which task may interrupt."""

from mav_tasks.settings import Queueing, Watch
from mav_tasks.tasks.frames import local_place
from mav_tasks.tasks.goal import GoTo, LocalPlace, SingleGoal
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.view import ModeKind, VehicleView


def start_blocker(
    view: VehicleView, *, watch: Watch, now: float, goal: SingleGoal | None = None
) -> TaskReason:
    """Return why no task (or none with this goal) can take control of the vehicle now, or NONE.

    The server takes over only from HOLD, from a mode that it set, or from MANUAL while disarmed.
    """
    if not view.is_ours:
        return TaskReason.LEASE_LOST
    if not view.heard or view.is_unknown:
        return TaskReason.VEHICLE_SILENT
    if view.other_controller:
        return TaskReason.OTHER_CONTROLLER
    if view.is_booting:
        return TaskReason.NOT_READY
    if view.mode is ModeKind.OTHER or (view.mode is ModeKind.MANUAL and view.armed):
        return TaskReason.WRONG_MODE
    if view.motion is None or now - view.motion.at > watch.motion_fresh:
        return TaskReason.NO_POSITION
    if view.is_fence_unknown:
        return TaskReason.NO_POSITION
    if isinstance(goal, GoTo) and place_of(goal, view) is None:
        return TaskReason.NO_POSITION
    if not view.armed and not view.may_arm:
        return TaskReason.DISARMED
    if view.is_outside_own_fence:
        return TaskReason.OUTSIDE_OWN_FENCE
    if view.drives_on:
        return TaskReason.LOSS_FAILSAFE
    return TaskReason.NONE


def place_of(goal: GoTo, view: VehicleView) -> LocalPlace | None:
    """Return a goal's place in the vehicle's local frame, or None while that is unknown."""
    return local_place(view.home if goal.place is None else goal.place, view.origin)


def outranks(waiting: Task, running: Task, *, queueing: Queueing) -> bool:
    """Return whether a waiting task may interrupt a running one.

    Only the submitted or modified terms count, not aging and not an inherited rank.
    """
    if not running.terms.is_preemptible:
        return False
    if running.state not in (TaskState.STARTING, TaskState.EXECUTING):
        return False
    if waiting.terms.is_preemptive:
        return not running.terms.is_preemptive or waiting.priority > running.priority
    gap = queueing.preemption_gap
    return gap > 0 and waiting.priority - running.priority >= gap
