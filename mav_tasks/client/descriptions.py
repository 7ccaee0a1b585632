"""Tasks and queues in words: what a task does, its state, why it waits. Pure."""

from math import degrees

from mav_tasks.client.values import QueueStatus, TaskStatus
from mav_tasks.kinds import Unit
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of

UNITS = {Unit.METRES: "m", Unit.RADIANS: "deg", Unit.SECONDS: "s", Unit.ITEMS: "items"}

#: reasons of tasks that wait until the queue is resumed
UNTIL_RESUMED = (
    TaskReason.QUEUE_PAUSED,
    TaskReason.OPERATOR,
    TaskReason.TAKEOVER,
    TaskReason.FAILSAFE,
    TaskReason.RESTARTED,
)

#: what a person can do about a task that waits or is paused; each surface adds how one resumes
#: there, and the command that releases a held task, with the option that names the rover
REMEDIES: dict[TaskReason, str] = {
    **dict.fromkeys((*UNTIL_RESUMED, TaskReason.STOPPED), "To let it run, {resume}."),
    TaskReason.TAKEOVER: (
        "Once nobody else drives it, centre the sticks, set HOLD, then {resume}."
    ),
    TaskReason.FAILSAFE: "Remove the cause of the failsafe, set HOLD, then {resume}.",
    TaskReason.DISARMED: "Set HOLD and arm the rover, unless the server may; then {resume}.",
    TaskReason.WRONG_MODE: "Set the rover to HOLD, then {resume}.",
    TaskReason.NOT_READY: "Wait, or mend what the rover reports.",
    TaskReason.NO_POSITION: "Wait until the rover knows its position; check its GPS.",
    TaskReason.POSITION_LOST: "Wait until the rover knows its position; check its GPS.",
    TaskReason.VEHICLE_SILENT: "Check the rover's radio and power.",
    TaskReason.LINK_LOST: "Check the rover's radio and power.",
    TaskReason.LEASE_LOST: "Check the database and the network to it.",
    TaskReason.LOSS_FAILSAFE: (
        "Let the rover stop when setpoints end: run 'mav-tasks probe --set-failsafe{rover}'."
    ),
    TaskReason.OUTSIDE_OWN_FENCE: "Drive the rover back manually, or switch that fence off.",
    TaskReason.OTHER_CONTROLLER: "End the other program that drives the rover.",
    TaskReason.HELD_AHEAD: "Look at the queue, and release the held task before it{release}.",
    TaskReason.WAITING_FOR_START: "Start this mission.",
}

#: what a STOP that is in force has not reached, by the reason of its answer
STOP_IN_FORCE: dict[int, str] = {
    TaskReason.VEHICLE_SILENT: (
        "STOP is in force, but a rover is silent and may still move;"
        " the server stops it when it is heard again"
    ),
    TaskReason.STORE_UNAVAILABLE: (
        "STOP is in force, but not stored: a restart of the server loses it"
    ),
}


def state_of(status: TaskStatus) -> str:
    return status.state.name.lower()


def what_of(status: TaskStatus) -> str:
    """Return what a task does: "move 2 m"."""
    what, colon, _ = status.words.partition(" '" if status.label else ": ")
    return what if colon else f"command {status.command}"


def why_of(status: TaskStatus) -> str:
    """Return why a task is in its state, with the rover's text; "" if there is no reason."""
    if not status.reason:
        return ""
    why = words_of(status.reason)
    _, colon, says = status.words.partition(f"({why}: ")  # it may be cut short
    return f"{why}: {says.removesuffix(')')}" if colon else why


def end_of(status: TaskStatus) -> str:
    """Return why a task is in its state; "" if it repeats the state ("cancelled: cancelled")."""
    why = why_of(status)
    return "" if why == state_of(status) else why


def needs_decision(status: TaskStatus) -> bool:
    """Return whether a task is held and nobody has released it yet."""
    return status.state is TaskState.HELD and status.reason >= TaskReason.OUTCOME_UNKNOWN


def remedy_for(reason: TaskReason, *, resume: str, release: str = "", rover: str = "") -> str:
    """Return what a person can do about a reason to wait; "" if nothing.

    ``resume``: how; ``release``: ": " and the command; ``rover``: the option that names the rover.
    """
    return REMEDIES.get(reason, "").format(resume=resume, release=release, rover=rover)


def remedy_for_pause(reason: TaskReason, *, resume: str) -> str:
    """Return what a person can do about a paused queue. ``resume``: how."""
    return remedy_for(reason if reason in UNTIL_RESUMED else TaskReason.STOPPED, resume=resume)


def with_resume(text: str, resume: str) -> str:
    """Return a text for ground stations, whose button is "Continue", with another way to resume."""
    text = text.replace("press Continue", resume)
    return text.replace("Press Continue", resume[:1].upper() + resume[1:])


def waits_of(queue: QueueStatus) -> dict[int, str]:
    """Return why each task of a queue waits, by its id: "behind task 4"."""
    waits: dict[int, str] = {}
    before = None if queue.current is None else queue.current.id
    for status in queue.waiting:
        is_known = before is not None and status.reason is TaskReason.BEHIND_OTHERS
        why = f"behind task {before}" if is_known else why_of(status)
        if status.after and status.reason is TaskReason.DEPENDENCY:
            why = f"after task {status.after}"
        elif status.after and status.reason is TaskReason.START_TIME:
            why = f"{why}, after task {status.after}"
        waits[status.id] = why
        if status.state is TaskState.QUEUED:
            before = status.id
    return waits


def left(status: TaskStatus) -> tuple[float | None, str | None]:
    """Return the remainder of a task as a number and its unit."""
    if status.remaining is None or status.unit is Unit.NONE:
        return None, None
    is_angle = status.unit is Unit.RADIANS
    return degrees(status.remaining) if is_angle else status.remaining, UNITS[status.unit]


def is_of_last_save(status: TaskStatus) -> bool:
    """Return whether the progress is a last save: the server died while it drove the task."""
    return status.state is TaskState.HELD and status.reason is TaskReason.OUTCOME_UNKNOWN
