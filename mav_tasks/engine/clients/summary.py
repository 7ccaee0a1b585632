"""The text for a ground station that is new, or back: why a rover's tasks do not go on.

That station has missed the earlier texts. The important words come first, because some clients show
the first 50 characters only.
"""

from mav_tasks.engine.commands.submissions import PAUSED
from mav_tasks.engine.vehicles.hands import BUTTONS
from mav_tasks.tasks.goal import describe
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.vehicle_tasks import VehicleTasks


def summary_of(tasks: VehicleTasks) -> str:
    """Return why a rover's tasks are stopped, and what to press; "" if they are not."""
    waiting = len(tasks.waiting)
    wait = f"; {_waiting(waiting)}" if waiting else ""
    held = _in_state(tasks, TaskState.HELD)
    if tasks.paused is TaskReason.STOPPED:
        return f"STOP in force, press Continue{wait}"
    if held is not None:
        return f"Task {held.id} held: {words_of(held.reason)}. Press {BUTTONS}{wait}"
    active = _in_state(tasks, TaskState.PAUSED)
    why = PAUSED.get(tasks.paused, words_of(tasks.paused))
    if tasks.paused and active is not None:
        return f"Task {active.id} paused, press Continue ({why}){wait}"
    if tasks.paused and waiting:
        return f"{_waiting(waiting)}, press Continue ({why})"
    return ""


def next_words(tasks: VehicleTasks) -> str:
    """Return which task drives next, to end a text; "" if none does."""
    task_id = None if tasks.held else tasks.executor.task_id or tasks.next_id
    task = None if task_id is None else tasks.registry[task_id]
    if task is None or task.state is TaskState.CANCELLING:
        return ""
    behind = len(tasks.waiting) - (task.id in tasks.waiting)
    wait = f"; {_waiting(behind)} behind it" if behind else ""
    return f": task {task.id} is next, {describe(task.goal)}{wait}"


def _waiting(count: int) -> str:
    return "1 task waits" if count == 1 else f"{count} tasks wait"


def _in_state(tasks: VehicleTasks, state: TaskState) -> Task | None:
    """Return the first active or suspended task in this state."""
    active = [] if tasks.active is None else [tasks.active]
    return next((task for task in (*active, *tasks.suspended) if task.state is state), None)
