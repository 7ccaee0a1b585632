"""Advice to an agent about a task, which names the tools to call. Pure."""

from mav_tasks.client.descriptions import UNTIL_RESUMED, why_of
from mav_tasks.client.values import QueueStatus, TaskStatus
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of

#: what a person has to do about a task that waits, by its reason
BY_A_PERSON = {
    TaskReason.DISARMED: "A person must arm the rover in HOLD, or call resume if a person agrees.",
    TaskReason.WRONG_MODE: "A person must set HOLD. Then call resume.",
    TaskReason.NOT_READY: "The rover is not ready. Wait, or tell a person what it reports.",
    TaskReason.LOSS_FAILSAFE: "An operator must run: mav-tasks probe --set-failsafe",
    TaskReason.OUTSIDE_OWN_FENCE: "A person must drive the rover back inside its fence.",
    TaskReason.WAITING_FOR_START: "A person must start this mission.",
}


def needs_decision(status: TaskStatus) -> bool:
    """Return whether a task is held and nobody has released it yet."""
    return status.state is TaskState.HELD and status.reason >= TaskReason.OUTCOME_UNKNOWN


def advice_of(status: TaskStatus) -> str:
    """Return what to do now about a task; "" if nothing."""
    epoch = status.halt_epoch
    if needs_decision(status):
        return (
            f"Task {status.id} is held ({why_of(status)}) and blocks the rover. Tell a person, "
            "or find out why. Then call release with how: 'remainder' finishes it, 'again' repeats "
            f"it from here, 'skip' drops it; epoch: {epoch}. If the queue is paused, "
            "resume it, too."
        )
    if status.state is TaskState.COMPLETED:
        return ""
    if status.is_over:
        return (
            "It ended without being completed. Look at queue: it may be paused. To drive again, "
            "submit a new task with a new idempotency_key."
        )
    if status.reason in UNTIL_RESUMED or status.reason is TaskReason.STOPPED:
        return _resume(why_of(status), epoch)
    if status.reason is TaskReason.HELD_AHEAD:
        return "A held task of this rover blocks it: look at queue, and release that task."
    waits = BY_A_PERSON.get(status.reason)
    return waits or "No action is needed: call wait until it has ended."


def advice_on_queue(queue: QueueStatus) -> str:
    """Return what to do now about a rover's queue; "" if nothing."""
    if queue.current is not None and needs_decision(queue.current):
        return advice_of(queue.current)
    if queue.paused is not None:
        return _resume(words_of(queue.paused), queue.halt_epoch)
    return ""


def _resume(why: str, epoch: int) -> str:
    return (
        f"The queue is paused ({why}): no task runs. If the rover may drive again, and a person "
        f"agrees if a person has stopped it, call resume with epoch: {epoch}."
    )
