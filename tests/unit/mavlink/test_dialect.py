"""What the generated dialect must have beside what pymavlink ships."""

import struct

import pytest

from mav_tasks.mavlink import _dialect
from mav_tasks.mavlink import messages as m

STATES = 14


def test_task_status_is_as_the_contract_draws_it() -> None:
    assert (m.TaskStatus.id, m.TaskStatus.unpacker.size) == (54000, 200)
    assert m.TaskStatus.unpacker.format == "<IIIIIffffHHHHBBBBBBBBBB50sI24sI64s"
    assert m.TaskStatus.ordered_fieldnames == m.TaskStatus.fieldnames
    assert struct.calcsize("<5I4f4H10B50sI24sI64s") == 200


def test_task_queue_status_is_as_the_contract_draws_it() -> None:
    assert (m.TaskQueueStatus.id, m.TaskQueueStatus.unpacker.size) == (54001, 126)
    assert m.TaskQueueStatus.ordered_fieldnames == [
        "time_boot_ms",
        "version",
        "running_id",
        "next_id",
        "capacity",
        "counts",
        "paused_reason",
        "flags",
        "halt_epoch",
        "heartbeat_age",
        "gateway",
    ]
    assert m.TaskQueueStatus.array_lengths[5] == STATES


def test_task_timing_is_as_the_contract_draws_it() -> None:
    assert (m.TaskTiming.id, m.TaskTiming.unpacker.size) == (54002, 34)
    assert m.TaskTiming.unpacker.format == "<IIIIffffBB"
    assert m.TaskTiming.ordered_fieldnames == m.TaskTiming.fieldnames
    assert struct.calcsize("<4I4f2B") == 34


def test_protocol_version_has_the_public_crc_extra() -> None:
    assert (m.ProtocolVersion.id, m.ProtocolVersion.crc_extra) == (300, 217)


def test_what_the_base_lacks_is_as_the_set_that_has_it() -> None:
    from pymavlink.dialects.v20 import development

    for number in (435, 436, 437):  # AVAILABLE_MODES, CURRENT_MODE, AVAILABLE_MODES_MONITOR
        ours, theirs = m.ALL[number], development.mavlink_map[number]
        assert ours.msgname == theirs.msgname
        assert ours.crc_extra == theirs.crc_extra
        assert ours.unpacker.format == theirs.unpacker.format
        assert ours.ordered_fieldnames == theirs.ordered_fieldnames


@pytest.mark.parametrize(
    ("message", "extensions"),
    [
        (m.MissionCount, ["mission_type", "opaque_id"]),
        (m.MissionAck, ["mission_type", "opaque_id"]),
        (
            m.MissionCurrent,
            ["total", "mission_state", "mission_mode", "mission_id", "fence_id", "rally_points_id"],
        ),
    ],
)
def test_mission_messages_carry_the_ids_of_plans(
    message: type[m.Message], extensions: list[str]
) -> None:
    assert message.fieldnames[-len(extensions) :] == extensions
    assert message.ordered_fieldnames[-len(extensions) :] == extensions  # extensions are not sorted


@pytest.mark.parametrize(
    ("message", "number", "crc_extra"),
    [  # CRC_EXTRA as pymavlink ships it: an extension field must not change it
        (m.MissionCount, 44, 221),
        (m.MissionAck, 47, 153),
        (m.MissionCurrent, 42, 28),
        (m.CommandAck, 77, 143),
        (m.CommandLong, 76, 152),
        (m.Heartbeat, 0, 50),
    ],
)
def test_extensions_leave_crc_extra_alone(
    message: type[m.Message], number: int, crc_extra: int
) -> None:
    assert (message.id, message.crc_extra) == (number, crc_extra)


def test_every_readable_name_stands_for_a_message_of_the_dialect() -> None:
    ours: list[type[m.Message]] = [
        kind for name, kind in vars(m).items() if isinstance(kind, type) and name != "Message"
    ]
    assert len(ours) > 50
    assert [kind for kind in ours if m.ALL[kind.id] is not kind] == []


def test_our_numbers_are_in_the_range_that_is_free() -> None:
    messages = sorted(number for number in m.ALL if 54000 <= number < 60000)
    commands = [number for number in _dialect.enums["MAV_CMD"] if 54000 <= number < 60000]
    assert messages == [54000, 54001, 54002]
    assert sorted(commands)[:9] == [54000, 54001, 54002, 54003, 54010, 54011, 54012, 54013, 54014]
