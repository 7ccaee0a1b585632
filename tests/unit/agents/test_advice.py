from typing import Any

import pytest

from mav_tasks.agents.advice import advice_of, advice_on_queue
from mav_tasks.agents.forms import TASK, queue_form, refusal, result, task_form
from mav_tasks.cli.words import headline_of
from mav_tasks.client.descriptions import needs_decision, remedy_for_pause
from mav_tasks.client.values import QueueStatus, TaskStatus, Unit
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.web.forms import queue_form as page_form

S, R = TaskState, TaskReason


def task(state: TaskState, reason: TaskReason = R.NONE, **fields: Any) -> TaskStatus:
    known: dict[str, Any] = {
        "id": 3,
        "vehicle": 1,
        "words": "move 2 m: x",
        "priority": 5,
        "after": 0,
        "nonce": 7,
        "command": 300,
        "progress": 0.5,
        "remaining": 1.0,
        "unit": Unit.METRES,
        "position": None,
        "time_to_start": None,
        "time_to_finish": None,
        "execution_time": None,
        "item": 1,
        "items": 1,
        "submitter": "244/190",
        "version": 4,
        "halt_epoch": 12,
    }
    return TaskStatus(state=state, reason=reason, **(known | fields))


def queue(current: TaskStatus | None, paused: TaskReason | None = None) -> QueueStatus:
    return QueueStatus(1, 3, None, 100, {}, paused, (), current, 1, halt_epoch=12)


@pytest.mark.parametrize(
    ("status", "says"),
    [
        (task(S.EXECUTING), "call wait"),
        (task(S.QUEUED, R.BEHIND_OTHERS), "call wait"),
        (task(S.QUEUED, R.QUEUE_PAUSED), "call resume with epoch: 12"),
        (task(S.PAUSED, R.TAKEOVER), "call resume with epoch: 12"),
        (task(S.QUEUED, R.HELD_AHEAD), "release the held task"),
        (task(S.QUEUED, R.DISARMED), "Arm the rover in HOLD; or, if the server may arm it, call"),
        (task(S.QUEUED, R.VEHICLE_SILENT), "tell a person to do it: Check the rover's radio"),
        (task(S.PAUSED, R.LINK_LOST), "Check the rover's radio and power."),
        (task(S.QUEUED, R.NO_POSITION), "check its GPS"),
        (task(S.QUEUED, R.OTHER_CONTROLLER), "End the other program"),
        (task(S.HELD, R.OFF_TRACK), "is held (off track)"),
        (task(S.HELD, R.OFF_TRACK), "epoch: 12"),
        (task(S.HELD, R.NO_POSITION), "It waits: no position."),  # released
        (task(S.FAILED, R.STUCK), "new idempotency_key"),
    ],
)
def test_each_task_says_what_to_do(status: TaskStatus, says: str) -> None:
    assert says in advice_of(status)


def test_nothing_is_to_be_done_about_a_completed_task() -> None:
    assert advice_of(task(S.COMPLETED)) == ""


def test_a_held_task_needs_a_decision_until_it_is_released() -> None:
    assert needs_decision(task(S.HELD, R.LATE))
    assert not needs_decision(task(S.HELD, R.NO_POSITION))  # released; it waits to start
    assert not needs_decision(task(S.EXECUTING))


@pytest.mark.parametrize("reason", [R.OPERATOR, R.STOPPED, R.TAKEOVER, R.STUCK, R.ARM_REFUSED])
def test_each_surface_says_how_a_paused_queue_is_resumed(reason: TaskReason) -> None:
    paused = queue(None, reason)
    said = remedy_for_pause(reason, resume="{}")
    assert advice_on_queue(paused).endswith(said.format("call resume with epoch: 12"))
    assert page_form(paused)["paused_remedy"] == said.format("press Resume")
    clause = said.format("use: mav-tasks resume").removesuffix(".")
    assert clause[1:] in headline_of(paused)


def test_a_queue_says_what_blocks_it() -> None:
    assert "is held" in advice_on_queue(queue(task(S.HELD, R.LATE), R.OPERATOR))
    assert "(STOP): no task runs" in advice_on_queue(queue(None, R.STOPPED))
    assert advice_on_queue(queue(task(S.EXECUTING))) == ""


def test_the_forms_have_what_their_schema_requires() -> None:
    form = task_form(task(S.HELD, R.LATE))
    assert set(TASK["required"]) <= set(form)
    assert (form["why"], form["is_over"], form["halt_epoch"]) == ("server was late", False, 12)
    assert queue_form(queue(task(S.EXECUTING)))["current"]["id"] == 3


def test_a_result_is_structured_and_text_and_a_refusal_only_its_reason() -> None:
    done = result({"done": "é"})
    assert done["structuredContent"] == {"done": "é"}
    assert done["content"] == [{"type": "text", "text": '{"done": "é"}'}]
    assert (done["isError"], refusal("why")["isError"]) == (False, True)
    assert "structuredContent" not in refusal("why")
