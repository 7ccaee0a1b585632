"""The public surface, pinned: that it grows is a decision."""

import pytest

import mav_tasks
from mav_tasks.engine.engine import Engine


def test_the_engine_has_five_methods_and_six_views() -> None:
    methods = {"handle", "handle_deadline", "next_deadline", "take_events", "take_packets"}
    views = {"snapshot", "parameters", "reach", "expected", "stop_until", "has_heard"}
    assert {name for name in vars(Engine) if not name.startswith("_")} == methods | views


def test_what_a_script_may_import_is_there_and_no_more() -> None:
    assert mav_tasks.__all__ == [
        "Act",
        "Client",
        "ClientError",
        "Drive",
        "Face",
        "GlobalPlace",
        "GoTo",
        "Key",
        "LocalPlace",
        "MavTasksError",
        "Move",
        "NoAnswer",
        "NoSuchVehicle",
        "QueueStatus",
        "Refused",
        "Rotate",
        "SyncClient",
        "SyncTask",
        "Task",
        "TaskFailed",
        "TaskReason",
        "TaskState",
        "TaskStatus",
        "TaskTiming",
        "Text",
        "UsageError",
        "VehicleStatus",
        "Wait",
        "read_plan",
        "write_plan",
    ]
    for name in mav_tasks.__all__:
        assert getattr(mav_tasks, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'Rover'"):
        mav_tasks.Rover  # noqa: B018
