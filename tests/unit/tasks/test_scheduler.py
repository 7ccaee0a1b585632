from dataclasses import replace

import pytest

from mav_tasks.settings import Watch
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.scheduler import start_blocker
from mav_tasks.tasks.view import ModeKind, VehicleView
from tests.unit.tasks.samples import idle_vehicle

R = TaskReason
NOW = 10.0
READY = idle_vehicle(at=NOW)


def blocker(view: VehicleView, *, now: float = NOW) -> TaskReason:
    return start_blocker(view, watch=Watch(), now=now)


@pytest.mark.parametrize(
    ("view", "reason"),
    [
        (READY, R.NONE),
        (replace(READY, heard=False), R.VEHICLE_SILENT),
        (replace(READY, other_controller=True), R.OTHER_CONTROLLER),
        (replace(READY, mode=ModeKind.OTHER), R.WRONG_MODE),
        (replace(READY, mode=ModeKind.MANUAL), R.NONE),
        (replace(READY, mode=ModeKind.MANUAL, armed=True), R.WRONG_MODE),
        (replace(READY, mode=ModeKind.OURS, armed=True), R.NONE),
        (replace(READY, motion=None), R.NO_POSITION),
        (replace(READY, may_arm=False), R.DISARMED),
        (replace(READY, may_arm=False, armed=True), R.NONE),
    ],
)
def test_a_task_starts_only_on_a_vehicle_that_may_be_taken(
    view: VehicleView, reason: TaskReason
) -> None:
    assert blocker(view) is reason


def test_old_data_are_no_position() -> None:
    fresh = Watch().motion_fresh
    assert blocker(READY, now=NOW + fresh - 0.001) is R.NONE
    assert blocker(READY, now=NOW + fresh + 0.001) is R.NO_POSITION


def test_silence_is_named_first() -> None:
    view = replace(READY, heard=False, motion=None, mode=ModeKind.OTHER, other_controller=True)
    assert blocker(view) is R.VEHICLE_SILENT
