"""Rovers, queues and tasks as the API and the page show them: JSON with words for people. Pure."""

from collections.abc import Iterable, Mapping
from typing import Any

from mav_tasks.client.descriptions import (
    UNTIL_RESUMED,
    needs_decision,
    remedy_for,
    remedy_for_pause,
    waits_of,
    why_of,
    with_resume,
)
from mav_tasks.client.json_form import queue_json, task_json, vehicle_json
from mav_tasks.client.values import QueueStatus, TaskStatus, Text, VehicleStatus
from mav_tasks.mavlink.address import who_is
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason, TaskState, words_of

#: how one resumes a rover on the page
PRESS = "press Resume"

WHY_PAUSED = {
    TaskReason.OPERATOR: "somebody paused it",
    TaskReason.QUEUE_PAUSED: "somebody paused it",
    TaskReason.STOPPED: "STOP is in force",
    TaskReason.TAKEOVER: "a person or another program took over the rover",
    TaskReason.FAILSAFE: "the rover's own failsafe took over",
    TaskReason.RESTARTED: "the server or the rover was restarted",
}


def task_form(
    status: TaskStatus,
    *,
    why: str | None = None,
    goals: Mapping[int, Any] | None = None,
    user: str = "",
) -> dict[str, Any]:
    """Return a task; ``why`` it waits, if its queue tells more than its own status.

    ``user``: of the page, who submitted it; "": not known.
    """
    form = task_json(status)
    return form | {
        "why": form["why"] if why is None else why or None,
        "remedy": remedy_of(status),
        "submitted_by": user or who_is(status.submitter),
        "goals": (goals or {}).get(status.id),
    }


def remedy_of(status: TaskStatus) -> dict[str, str] | None:
    """Return what a person can do about a task that waits; None: nothing needs to be done."""
    if status.is_over:
        return None
    if needs_decision(status):
        words = "Release it: again from here, only the rest of it, or skip it."
        return {"action": "release", "words": words}
    words = remedy_for(status.reason, resume=PRESS)
    is_resume = status.reason in UNTIL_RESUMED or status.reason is TaskReason.STOPPED
    return {"action": "resume" if is_resume else "none", "words": words} if words else None


def queue_form(queue: QueueStatus, *, goals: Mapping[int, Any] | None = None) -> dict[str, Any]:
    """Return a rover's queue, with the tasks in the order in which they run."""
    waits = waits_of(queue)
    current = queue.current
    return queue_json(queue) | {
        "paused_words": paused_words(queue.paused),
        "paused_remedy": queue.paused and remedy_for_pause(queue.paused, resume=PRESS),
        "more": max(queue.waiting_count - len(queue.waiting), 0),
        "current": None if current is None else task_form(current, goals=goals),
        "waiting": [task_form(e, why=waits[e.id], goals=goals) for e in queue.waiting],
    }


def paused_words(reason: TaskReason | None) -> str | None:
    """Return why a queue is paused, as a clause; None: it is not paused."""
    if reason is None:
        return None
    return WHY_PAUSED.get(reason, words_of(reason))


def vehicle_form(
    vehicle: VehicleStatus,
    queue: QueueStatus | None,
    *,
    prearm: Iterable[str] = (),
    goal: Mapping[str, float] | None = None,
    origin: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return a rover, who controls it, and what keeps it from driving, in words."""
    form = vehicle_json(vehicle)
    battery, voltage = form.pop("battery"), form.pop("voltage")
    control, words = _control_of(vehicle, queue)
    return form | {
        "data_age": form.pop("position_age"),
        "battery": None
        if battery is None and voltage is None
        else {"percent": None if battery is None else round(100 * battery), "voltage": voltage},
        "prearm": list(prearm),
        "control": control,
        "control_words": words,
        "goal": goal,
        "origin": origin,
    }


def text_form(text: Text, *, number: int, at: float) -> dict[str, Any]:
    """Return a text of a rover or the server."""
    return {
        "number": number,
        "at": round(at, 3),
        "vehicle": text.vehicle,
        "component": text.component,
        "severity": text.severity,
        "words": with_resume(text.words, PRESS),
    }


def _control_of(vehicle: VehicleStatus, queue: QueueStatus | None) -> tuple[str, str]:
    name = f"Rover {vehicle.id}"
    if not vehicle.is_heard:
        return "silent", f"{name} is silent. {remedy_for(TaskReason.VEHICLE_SILENT, resume=PRESS)}"
    if queue is None or queue.paused is None:
        current = None if queue is None else queue.current
        if current is not None and current.state is TaskState.HELD:
            held = f"Task {current.id} of rover {vehicle.id} is held ({why_of(current)})."
            return "tasks", f"{held} Release it, so that the queue goes on."
        return "tasks", f"{name} runs its tasks."
    why = paused_words(queue.paused)
    control = "taken over" if queue.paused in TAKEN else "paused"
    if queue.paused is TaskReason.STOPPED:
        control = "stopped"
    return control, f"{name} is paused: {why}. {remedy_for_pause(queue.paused, resume=PRESS)}"
