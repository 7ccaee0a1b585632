"""Tasks become messages; a refusal becomes a result."""

from math import inf, nan

import pytest

from mav_tasks.engine.commands import translate
from mav_tasks.mavlink.enums import MavResult
from mav_tasks.mavlink.messages import CommandLong
from mav_tasks.services.command_receiver import Command, command_of
from mav_tasks.tasks.events import TaskWaits
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import TaskId

R = TaskReason


def command(number: int, *params: float) -> Command:
    filled = (*params, *(0.0,) * (6 - len(params)), 5.0)[:7]
    return command_of(CommandLong(1, 191, number, 0, *filled))


@pytest.mark.parametrize("reason", [r for r in TaskReason if 0 < r < 30])
def test_every_reason_to_wait_has_words_for_people(reason: TaskReason) -> None:
    told = translate.text_of(TaskWaits(TaskId(3), 1, reason, at=1.0))
    assert told is not None
    assert told[2].removeprefix("Task 3 waits: ")


@pytest.mark.parametrize("reason", [r for r in TaskReason if r >= 100])
def test_no_refusal_is_answered_with_a_result_that_crashes_clients(reason: TaskReason) -> None:
    assert MavResult.ACCEPTED < translate.result_of(reason) <= MavResult.FAILED


@pytest.mark.parametrize(
    ("reason", "result"),
    [
        (R.QUEUE_FULL, MavResult.TEMPORARILY_REJECTED),
        (R.STORE_UNAVAILABLE, MavResult.TEMPORARILY_REJECTED),
        (R.BAD_PARAMETER, MavResult.DENIED),
        (R.NOT_FOUND, MavResult.DENIED),
        (R.NONCE_REUSED, MavResult.DENIED),
        (R.NOT_SUPPORTED_BY_VEHICLE, MavResult.DENIED),
        (R.VEHICLE_SILENT, MavResult.FAILED),
    ],
)
def test_a_refusal_has_its_answer_on_the_wire(reason: TaskReason, result: MavResult) -> None:
    assert translate.result_of(reason) is result


@pytest.mark.parametrize(
    ("value", "number"), [(54000.0, 54000), (0.0, 0), (-1.0, -1), (1.5, -1), (nan, -1), (inf, -1)]
)
def test_a_number_of_nothing_is_minus_one(value: float, number: int) -> None:
    assert translate.message_id_of(command(512, value)) == number
    assert translate.task_id_of(command(512, 54000, value)) == number
