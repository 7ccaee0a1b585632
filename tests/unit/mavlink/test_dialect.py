"""What the generated dialect must have beside what pymavlink ships, and our names for it."""

import re
from enum import IntEnum, IntFlag
from inspect import getmembers, isclass

import pytest
from pymavlink.dialects.v20 import development

from mav_tasks.mavlink import _dialect, enums
from mav_tasks.mavlink import messages as m
from mav_tasks.tasks.lifecycle import TaskReason, TaskState


def test_what_the_base_lacks_is_as_the_set_that_has_it() -> None:
    for number in (435, 436, 437):  # AVAILABLE_MODES, CURRENT_MODE, AVAILABLE_MODES_MONITOR
        ours, theirs = m.ALL[number], development.mavlink_map[number]
        assert ours.msgname == theirs.msgname
        assert ours.crc_extra == theirs.crc_extra
        assert ours.unpacker.format == theirs.unpacker.format
        assert ours.ordered_fieldnames == theirs.ordered_fieldnames


@pytest.mark.parametrize(
    ("message", "number", "crc_extra", "extensions"),
    [  # CRC_EXTRA as pymavlink ships it: an extension field must not change it
        (m.MissionCount, 44, 221, "mission_type opaque_id"),
        (m.MissionAck, 47, 153, "mission_type opaque_id"),
        (
            *(m.MissionCurrent, 42, 28),
            "total mission_state mission_mode mission_id fence_id rally_points_id",
        ),
        (m.CommandAck, 77, 143, "progress result_param2 target_system target_component"),
        (m.ProtocolVersion, 300, 217, ""),
    ],
)
def test_extensions_come_last_and_leave_crc_extra_alone(
    message: type[m.Message], number: int, crc_extra: int, extensions: str
) -> None:
    assert (message.id, message.crc_extra) == (number, crc_extra)
    names = extensions.split()
    for fields in (message.fieldnames, message.ordered_fieldnames):
        assert fields[len(fields) - len(names) :] == names  # they are not sorted


def test_every_member_of_our_enums_has_the_number_of_its_definition() -> None:
    prefixes = {"MavComponent": "MAV_COMP_ID", "MavMissionResult": "MAV_MISSION"}
    ours = [
        enum
        for _, enum in getmembers(enums, isclass)
        if issubclass(enum, IntEnum | IntFlag) and enum.__module__ == enums.__name__
    ]
    assert len(ours) >= 12
    for enum in ours:
        name = re.sub(r"(?<!^)(?=[A-Z])", "_", enum.__name__).upper()  # MavModeFlag: MAV_MODE_FLAG
        prefix = prefixes.get(enum.__name__, name)
        for member in enum:
            assert getattr(_dialect, f"{prefix}_{member.name}", None) == member.value, member
    assert max(enums.MavResult) < 7, "larger ones crash MAVSDK"


def numbers_of(name: str) -> dict[str, int]:
    """The members of an enum of the dialect, by their short names."""
    return {
        entry.name.removeprefix(f"{name}_"): number
        for number, entry in _dialect.enums[name].items()
        if not entry.name.endswith("_ENUM_END")
    }


def test_states_and_reasons_of_tasks_are_those_of_the_dialect() -> None:
    assert {state.name: state.value for state in TaskState} == numbers_of("TASK_STATE")
    assert {reason.name: reason.value for reason in TaskReason} == numbers_of("TASK_REASON")
