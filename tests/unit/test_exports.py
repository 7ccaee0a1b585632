"""The public surface, pinned: that it grows is a decision."""

import dataclasses
import inspect
import re
from typing import Any

import pytest

import mav_tasks
from mav_tasks import errors, settings
from mav_tasks.engine.engine import Engine
from mav_tasks.errors import MavTasksError

KINDS: list[Any] = [
    kind
    for _, kind in inspect.getmembers(settings, inspect.isclass)
    if dataclasses.is_dataclass(kind) and kind.__module__ == settings.__name__
]


def public(thing: object) -> list[str]:
    return sorted(name for name in vars(thing) if not name.startswith("_"))


def test_the_engine_has_five_methods_and_six_views() -> None:
    methods = ["handle", "handle_deadline", "next_deadline", "take_events", "take_packets"]
    views = ["snapshot", "parameters", "reach", "expected", "stop_until", "has_heard"]
    assert public(Engine) == sorted([*methods, *views])


def test_time_comes_in_as_a_keyword() -> None:
    for name in ("handle", "handle_deadline", "snapshot", "reach"):
        now = inspect.signature(getattr(Engine, name)).parameters["now"]
        assert (now.kind, now.default) == (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.empty)


def test_settings_are_frozen() -> None:
    for kind in KINDS:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(kind(), dataclasses.fields(kind)[0].name, None)


def test_the_tree_of_errors_is_the_one_in_its_docstring() -> None:
    drawing = (errors.__doc__ or "").split("::")[1]
    drawn: dict[str, str] = {}
    path: list[str] = []
    for line in drawing.splitlines():
        found = re.match(r"    ([│├└─ ]*)([A-Z]\w+)", line)
        if found is not None:
            depth = len(found[1]) // 4
            path[depth:] = [found[2]]
            drawn[found[2]] = path[depth - 1] if depth else "Exception"
    kinds: list[Any] = [
        kind
        for _, kind in inspect.getmembers(errors, inspect.isclass)
        if kind.__module__ == errors.__name__
    ]
    assert drawn == {kind.__name__: kind.__base__.__name__ for kind in kinds}
    assert all(issubclass(kind, MavTasksError) for kind in kinds)


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
