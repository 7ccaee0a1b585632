"""What is shown of the tasks: each change with all that is known of the task."""

from dataclasses import replace
from typing import Any

from mav_tasks.mcap_export.task_views import TaskViews
from mav_tasks.tasks.events import (
    Event,
    QueuePaused,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskProgressed,
    TaskSubmitted,
    TaskWithdrawn,
)
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Marks, Progress, Submitter, Task, TaskId, Terms
from tests.unit.mcap_export.json_schema import check

SENDER = Submitter("clients", "127.0.0.1:5", 255, 190)
TERMS = Terms(priority=7, label="patrol")
TASK = Task(TaskId(3), 1, 54000, Move(2.0), SENDER, Marks(), 0.0, terms=TERMS)


def changed(old: TaskState, new: TaskState, reason: TaskReason, version: int) -> Event:
    return TaskChanged(TaskId(3), 1, version, old, new, reason, "server", 1.0, Progress())


def told(views: TaskViews, *events: Event) -> list[tuple[str, dict[str, Any]]]:
    found = [seen for event in events for seen in views.of(event, time=5_000_000_007)]
    for seen in found:
        check(seen.values, seen.schema.body)
    return [(seen.topic, dict(seen.values)) for seen in found]


def changes(views: TaskViews, *events: Event) -> list[dict[str, Any]]:
    return [values for topic, values in told(views, *events) if topic == "/tasks/changes"]


def test_a_change_has_ids_state_reason_label_and_words() -> None:
    fails = changed(TaskState.EXECUTING, TaskState.FAILED, TaskReason.STUCK, 4)
    submitted, failed = changes(TaskViews(), TaskSubmitted(TASK, 0.0), fails)
    assert submitted == {
        "timestamp": {"sec": 5, "nsec": 7},
        "event": "submitted",
        "rover": 1,
        "task": 3,
        "version": 1,
        "state": "queued",
        "old": "unknown",
        "reason": "none",
        "label": "patrol",
        "priority": 7,
        "actor": str(SENDER),
        "words": str(TaskSubmitted(TASK, 0.0)),
    }
    assert failed == submitted | {
        "event": "changed",
        "version": 4,
        "state": "failed",
        "old": "executing",
        "reason": "stuck",
        "actor": "server",
        "words": str(fails),
    }


def test_a_modified_task_has_its_new_label_from_then_on() -> None:
    views = TaskViews()
    terms = replace(TERMS, label="home", priority=2)
    modified = TaskModified(TaskId(3), 1, 2, terms, "255/190", 1.0, TERMS)
    starts = changed(TaskState.QUEUED, TaskState.STARTING, TaskReason.NONE, 3)
    _, one, other = changes(views, TaskSubmitted(TASK, 0.0), modified, starts)
    assert (one["event"], one["state"], one["label"], one["priority"]) == (
        "modified",
        "queued",
        "home",
        2,
    )
    assert (other["state"], other["label"]) == ("starting", "home")


def test_an_assigned_task_is_of_its_new_rover_from_then_on() -> None:
    views = TaskViews()
    assigned = TaskAssigned(TaskId(3), 2, 2, 1, "rover 1: silent; free", 1.0)
    starts = changed(TaskState.QUEUED, TaskState.STARTING, TaskReason.NONE, 3)
    _, one, other = changes(views, TaskSubmitted(TASK, 0.0), assigned, starts)
    assert (one["event"], one["rover"], one["version"], one["state"]) == (
        "assigned",
        2,
        2,
        "queued",
    )
    assert other["rover"] == 2


def test_a_run_begins_with_the_tasks_of_the_run_before() -> None:
    views = TaskViews()
    done = replace(TASK, id=TaskId(2), state=TaskState.COMPLETED)
    held = replace(TASK, state=TaskState.HELD, reason=TaskReason.RESTARTED, version=9)
    (restored,) = views.restored([done, held], time=1)
    assert restored.values["event"] == "restored"
    assert [restored.values[name] for name in ("task", "state", "reason", "version")] == [
        3,
        "held",
        "restarted",
        9,
    ]
    check(restored.values, restored.schema.body)


def test_tasks_that_are_over_are_forgotten() -> None:
    views = TaskViews()
    ends = changed(TaskState.QUEUED, TaskState.CANCELLED, TaskReason.CANCELLED, 2)
    told(views, TaskSubmitted(TASK, 0.0), ends)
    told(views, TaskSubmitted(TASK, 0.0), TaskWithdrawn(TaskId(3), 1, 1.0))
    assert repr(views) == "TaskViews(0 tasks)"


def test_every_event_but_progress_is_a_text() -> None:
    paused = QueuePaused(1, TaskReason.TAKEOVER, "server", 1.0)
    progress = TaskProgressed(TaskId(3), 1, 2, Progress(), 1.0)
    ((topic, values),) = told(TaskViews(), paused, progress)
    assert (topic, values["level"], values["message"]) == ("/tasks/log", 3, str(paused))
