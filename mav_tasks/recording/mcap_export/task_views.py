"""Events of the server for viewers: changes of tasks, and all events as texts."""

import logging
from collections.abc import Iterator, Sequence
from typing import Any

from mav_tasks.recording.mcap_export import convention, schemas
from mav_tasks.recording.mcap_export.views import Seen, log, timestamp
from mav_tasks.store.rendering import clean, level_of
from mav_tasks.tasks.events import (
    SERVER,
    Event,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskProgressed,
    TaskSubmitted,
    TaskWithdrawn,
)
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.task import Task

_LEVELS = {logging.DEBUG: 1, logging.INFO: 2, logging.WARNING: 3, logging.ERROR: 4}


class TaskViews:
    """Knows the tasks of a run, so that each change names its label, priority and state."""

    def __init__(self) -> None:
        self._tasks: dict[int, dict[str, Any]] = {}

    def __repr__(self) -> str:
        return f"TaskViews({len(self._tasks)} tasks)"

    def restored(self, tasks: Sequence[Task], *, time: int) -> Iterator[Seen]:
        """Yield the tasks that were not over when the run began."""
        for task in tasks:
            if task.state not in TERMINAL:
                self._know(task)
                words = f"rover {task.vehicle}: task {task.id} restored: {_name(task.state)}"
                yield self._change("restored", task.id, time, actor=SERVER, words=words)

    def of(self, event: Event, *, time: int) -> Iterator[Seen]:
        """Yield what an event shows."""
        words = clean(str(event))
        match event:
            case TaskProgressed():
                return  # each second; TASK_STATUS has it
            case TaskSubmitted(task=task):
                self._know(task)
                yield self._change(
                    "submitted", task.id, time, actor=str(task.submitter), words=words
                )
            case TaskChanged():
                known = self._known(event.task_id, event.vehicle)
                known |= {
                    "version": event.version,
                    "state": _name(event.new),
                    "old": _name(event.old),
                    "reason": _name(event.reason),
                }
                yield self._change("changed", event.task_id, time, actor=event.actor, words=words)
                if event.new in TERMINAL:
                    del self._tasks[event.task_id]
            case TaskModified():
                known = self._known(event.task_id, event.vehicle)
                known |= {
                    "version": event.version,
                    "old": known["state"],
                    "label": event.terms.label,
                    "priority": event.terms.priority,
                }
                yield self._change("modified", event.task_id, time, actor=event.actor, words=words)
            case TaskAssigned():
                known = self._known(event.task_id, event.vehicle)
                known |= {
                    "rover": event.vehicle,
                    "version": event.version,
                    "old": known["state"],
                }
                yield self._change("assigned", event.task_id, time, actor=SERVER, words=words)
            case TaskWithdrawn():
                self._known(event.task_id, event.vehicle)
                yield self._change("withdrawn", event.task_id, time, actor=SERVER, words=words)
                del self._tasks[event.task_id]
        level = _LEVELS[level_of(event)]
        yield log(convention.TASK_LOG, time, level=level, name="mav-tasks", words=words)

    def _know(self, task: Task) -> None:
        self._tasks[task.id] = {
            "rover": task.vehicle,
            "task": task.id,
            "version": task.version,
            "state": _name(task.state),
            "old": _name(TaskState.UNKNOWN),
            "reason": _name(task.reason),
            "label": task.terms.label,
            "priority": task.priority,
        }

    def _known(self, task_id: int, vehicle: int) -> dict[str, Any]:
        """Return the known facts of a task; null where the record began after them."""
        return self._tasks.setdefault(
            task_id,
            {
                "rover": vehicle,
                "task": task_id,
                "version": 0,
                "state": _name(TaskState.UNKNOWN),
                "old": _name(TaskState.UNKNOWN),
                "reason": _name(TaskReason.NONE),
                "label": "",
                "priority": 0,
            },
        )

    def _change(self, event: str, task_id: int, time: int, *, actor: str, words: str) -> Seen:
        values = {
            "timestamp": timestamp(time),
            "event": event,
            **self._tasks[task_id],
            "actor": actor,
            "words": words,
        }
        return Seen(convention.TASK_CHANGES, schemas.TASK_CHANGE, time, values)


def _name(value: TaskState | TaskReason) -> str:
    return value.name.lower()
