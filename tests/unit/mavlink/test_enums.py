"""Every member of every enum of ours, held against the generated constants."""

import re
from enum import IntEnum, IntFlag
from inspect import getmembers, isclass

import pytest

from mav_tasks.mavlink import _dialect, enums
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

ENUMS: list[type[IntEnum] | type[IntFlag]] = [
    enum
    for _, enum in getmembers(enums, isclass)
    if issubclass(enum, IntEnum | IntFlag) and enum.__module__ == enums.__name__
]
MEMBERS = [
    pytest.param(enum, member, id=f"{enum.__name__}.{member.name}")
    for enum in ENUMS
    for member in enum
]
#: families whose members do not begin with the family's name
PREFIXES = {"MavComponent": "MAV_COMP_ID", "MavMissionResult": "MAV_MISSION"}


def dialect_prefix(name: str) -> str:
    """MavModeFlag -> MAV_MODE_FLAG."""
    return PREFIXES.get(name, re.sub(r"(?<!^)(?=[A-Z])", "_", name).upper())


@pytest.mark.parametrize(("enum", "member"), MEMBERS)
def test_a_member_has_the_number_of_its_definition(enum: type[IntEnum], member: IntEnum) -> None:
    name = f"{dialect_prefix(enum.__name__)}_{member.name}"
    assert getattr(_dialect, name, "not in the definitions") == member.value


def test_every_enum_was_looked_at() -> None:
    assert len(ENUMS) >= 12
    assert enums.MavResult in ENUMS


def numbers_of(name: str) -> dict[str, int]:
    """The members of an enum of the dialect, by their short names."""
    return {
        entry.name.removeprefix(f"{name}_"): number
        for number, entry in _dialect.enums[name].items()
        if not entry.name.endswith("_ENUM_END")
    }


def test_task_states_are_those_of_the_dialect() -> None:
    assert {state.name: state.value for state in TaskState} == numbers_of("TASK_STATE")


def test_task_reasons_are_those_of_the_dialect() -> None:
    assert {reason.name: reason.value for reason in TaskReason} == numbers_of("TASK_REASON")


def test_no_result_is_known_that_would_crash_mavsdk() -> None:
    assert max(enums.MavResult) < 7
