"""Advice to an agent about a task, which names the tools to call. Pure."""

from mav_tasks.client.descriptions import (
    UNTIL_RESUMED,
    needs_decision,
    remedy_for,
    remedy_for_pause,
    why_of,
)
from mav_tasks.client.values import QueueStatus, TaskStatus
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of


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
        return _resume(status.reason, why_of(status), epoch)
    if remedy := remedy_for(status.reason, resume=f"call resume with epoch: {epoch}"):
        return f"It waits: {why_of(status)}. Do this, or tell a person to do it: {remedy}"
    return "No action is needed: call wait until it has ended."


def advice_on_queue(queue: QueueStatus) -> str:
    """Return what to do now about a rover's queue; "" if nothing."""
    if queue.current is not None and needs_decision(queue.current):
        return advice_of(queue.current)
    if queue.paused is not None:
        return _resume(queue.paused, words_of(queue.paused), queue.halt_epoch)
    return ""


def _resume(reason: TaskReason, why: str, epoch: int) -> str:
    return (
        f"The queue is paused ({why}): no task runs. If the rover may drive again, and a person "
        "agrees if a person has stopped it: "
        + remedy_for_pause(reason, resume=f"call resume with epoch: {epoch}")
    )
