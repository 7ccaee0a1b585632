"""Commands become drafts, or a refusal that names the parameter."""

from math import inf, nan, radians

import pytest

from mav_tasks.engine import translate
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandInt, CommandLong
from mav_tasks.services.command_receiver import Command, command_of
from mav_tasks.settings import Driving
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Draft, Move, Rotate
from tests.unit.tasks.samples import SOMEBODY

R = TaskReason
DRIVING = Driving()


def command(number: int, *params: float) -> Command:
    filled = (*params, *(0.0,) * (6 - len(params)), 5.0)[:7]
    return command_of(CommandLong(1, 191, number, 0, *filled))


def move(*params: float) -> Command:
    return command(MavCmd.TASK_MOVE, *params)


def rotate(*params: float) -> Command:
    return command(MavCmd.TASK_ROTATE, *params)


def drafted(what: Command) -> Draft:
    return translate.draft_of(what, 1, SOMEBODY, DRIVING)


def refused(what: Command) -> tuple[int, str]:
    with pytest.raises(Rejection) as refusal:
        drafted(what)
    return refusal.value.reason, refusal.value.text


def test_a_move_in_metres_and_metres_a_second() -> None:
    assert drafted(move(-2.5, 0.75, 0, 77, 0, 0, 8)) == Draft(
        1, 54000, Move(-2.5, 0.75), 8, SOMEBODY, 77
    )


def test_a_rotation_in_degrees_becomes_radians() -> None:
    assert drafted(rotate(-450, 20)) == Draft(
        1, 54001, Rotate(radians(-450), radians(20)), 5, SOMEBODY, 0
    )


def test_a_command_int_carries_the_same() -> None:
    message = CommandInt(1, 191, 8, 54000, 0, 0, 2.0, nan, 0, 77, 0, 0, nan)
    assert drafted(command_of(message)) == Draft(1, 54000, Move(2.0), 5, SOMEBODY, 77)


def test_nan_is_not_given_wherever_there_is_a_default() -> None:
    assert drafted(move(2.0, nan, nan, nan, nan, nan, nan)) == Draft(
        1, 54000, Move(2.0), 5, SOMEBODY, 0
    )


@pytest.mark.parametrize(
    ("what", "text"),
    [
        (move(nan), "param1 distance is not given"),
        (move(0.0), "param1 distance is 0: nothing to do"),
        (move(inf), "param1 distance inf not in -10000..10000"),
        (move(-10_001), "param1 distance -10001 not in -10000..10000"),
        (move(1.0, -0.1), "param2 speed -0.1 not in 0..2"),
        (move(1.0, 2.5), "param2 speed 2.5 not in 0..2"),
        (move(1.0, inf), "param2 speed inf not in 0..2"),
        (move(1.0, 0, 0, -1), "param4 nonce -1 not in 0.."),
        (move(1.0, 0, 0, 0.5), "param4 nonce 0.5 is not a whole number"),
        (move(1.0, 0, 0, 0, 7), "param5 run after: must be 0 in this version"),
        (move(1.0, 0, 0, 0, 0, 3), "param6 start delay: must be 0 in this version"),
        (move(1.0, 0, 0, 0, 0, 0, 11), "param7 priority 11 not in 0..10"),
        (move(1.0, 0, 0, 0, 0, 0, 2.5), "param7 priority 2.5 is not a whole number"),
        (move(1.0, 0, 0, 0, 0, 0, -inf), "param7 priority -inf not in 0..10"),
        (rotate(nan), "param1 angle is not given"),
        (rotate(0.0), "param1 angle is 0: nothing to do"),
        (rotate(3601), "param1 angle 3601 not in -3600..3600"),
        (rotate(90, 91), "param2 rate 91 not in 0..90"),
    ],
)
def test_a_number_that_is_of_no_use_is_refused_by_its_name(what: Command, text: str) -> None:
    reason, words = refused(what)
    assert (reason, words[: len(text)]) == (R.BAD_PARAMETER, text)


def test_a_frame_that_nobody_knows_is_refused() -> None:
    message = CommandInt(1, 191, 99, 54000, 0, 0, 2.0, 0, 0, 0, 0, 0, 5)
    assert refused(command_of(message)) == (R.BAD_FRAME, "frame 99 is unknown")


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
        (R.NOT_SUPPORTED_BY_VEHICLE, MavResult.UNSUPPORTED),
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
