"""The policy table: what is not in it is the most dangerous thing, and each row is sane."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR, SAFETY, SUBMITTER
from mav_tasks.engine.policy import (
    Kind,
    Row,
    is_task_command,
    row_of,
    row_of_command,
    row_of_message,
)
from mav_tasks.engine.policy.commands import COMMANDS
from mav_tasks.engine.policy.messages import MESSAGES
from mav_tasks.mavlink import messages as m
from mav_tasks.settings import ROLES

#: of dialects that are not generated for us: names of what rovers may understand all the same
NAMES = {number: entry.name for number, entry in ardupilotmega.enums["MAV_CMD"].items()}
ENVELOPES = {m.CommandInt.id, m.CommandLong.id}  # judged by the command in them


def unknown(row: Row) -> bool:
    return (row.kind, row.role, row.passes_under_stop, row.passes_beside_task) == (
        Kind.MOTION,
        OPERATOR,
        False,
        False,
    )


@pytest.mark.parametrize("number", [0, 15, 53999, 54050, 65535])
def test_a_command_that_is_not_named_is_the_most_dangerous_thing(number: int) -> None:
    assert unknown(row_of_command(number))
    assert not row_of_command(number).is_claimed


@pytest.mark.parametrize("number", [54004, 54020, 54049])
def test_one_set_aside_for_tasks_is_ours_and_as_dangerous_before_it_has_a_meaning(
    number: int,
) -> None:
    assert is_task_command(number)
    assert unknown(row_of_command(number))
    assert row_of_command(number).is_claimed


@pytest.mark.parametrize("number", [75, 76, 0x7777, 0xFFFFFF])
def test_a_message_that_is_not_named_is_the_most_dangerous_thing(number: int) -> None:
    assert unknown(row_of_message(number))
    assert unknown(row_of(number, None))


def test_every_message_of_the_dialect_was_judged() -> None:
    assert set(m.ALL) - set(MESSAGES) == ENVELOPES


def test_every_command_of_mavlink_was_judged() -> None:
    assert {number for number in NAMES if not NAMES[number].endswith("ENUM_END")} <= set(COMMANDS)


def test_each_is_called_as_mavlink_calls_it() -> None:
    here = {number: f"MAV_CMD_{row.name}" for number, row in COMMANDS.items() if number in NAMES}
    assert here == {number: NAMES[number] for number in here}
    for messages in (m.ALL, ardupilotmega.mavlink_map):
        names = {number: row.name for number, row in MESSAGES.items() if number in messages}
        assert names == {number: messages[number].msgname for number in names}


def test_each_row_is_sane() -> None:
    for row in (*COMMANDS.values(), *MESSAGES.values()):
        assert row.role in ROLES, row
        assert row.name, row
        assert row.about, row
        assert not row.is_bound or row.role == SAFETY, row
        assert not row.needs_grant or row.kind is Kind.MOTION, row
        may_be_asked = row.kind not in (Kind.GO, Kind.MOTION, Kind.STICKS)
        assert row.role != OBSERVER or may_be_asked, row
        assert row.role != SUBMITTER or row.is_claimed, f"goes to the rover itself: {row}"
        on, harmless = row.passed_on, (Kind.HALT, Kind.QUESTION, Kind.TELL)
        assert not on.is_claimed, row
        assert on.role in (OPERATOR, SAFETY) or on.kind in harmless, row


@pytest.mark.parametrize("number", [16, 20, 192, 300, 54000, 54013])
def test_what_is_ours_is_another_thing_where_we_do_not_see_to_it(number: int) -> None:
    row = row_of_command(number)
    assert row.is_claimed
    assert row.passed_on.kind in (Kind.GO, Kind.MOTION)
    assert row.passed_on.role == OPERATOR


@pytest.mark.parametrize(
    ("message", "kind", "role"),
    [
        (m.FileTransferProtocol(0, 1, 1, [0, 0, 0, 4] + [0] * 247), Kind.QUESTION, OBSERVER),
        (m.FileTransferProtocol(0, 1, 1, [0, 0, 0, 6] + [0] * 247), Kind.WISH, SAFETY),
        (m.MissionCount(1, 1, 2, 0), Kind.WISH, SUBMITTER),
        (m.MissionCount(1, 1, 2, 1), Kind.WISH, SAFETY),
        (m.MissionRequestList(1, 1, 1), Kind.QUESTION, OBSERVER),
        (m.MissionClearAll(1, 1, 0), Kind.WISH, OPERATOR),
        (m.MissionClearAll(1, 1, 255), Kind.WISH, SAFETY),
    ],
)
def test_a_message_is_judged_by_what_it_says(message: m.Message, kind: Kind, role: str) -> None:
    row = row_of(type(message).id, message)
    assert (row.kind, row.role) == (kind, role)


@pytest.mark.parametrize(("current", "needs_grant"), [(0, False), (1, False), (2, True), (3, True)])
def test_an_item_that_is_a_go_to_drives(current: int, *, needs_grant: bool) -> None:
    item = m.MissionItemInt(1, 1, 0, 6, 16, current, 1, 0, 0, 0, 0, 1, 1, 0, 0)
    assert row_of(m.MissionItemInt.id, item).passed_on.needs_grant is needs_grant
