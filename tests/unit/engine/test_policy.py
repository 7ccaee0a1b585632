"""The policy table: what is not in it is the most dangerous thing, and each row is sane.

It stands below the seams: which message and command may what is a table, and only a walk over it
shows that every one that MAVLink has was judged.
"""

from pymavlink.dialects.v20 import ardupilotmega

from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR, SAFETY, SUBMITTER
from mav_tasks.engine.policy import Kind, Row, is_task_command, row_of_command, row_of_message
from mav_tasks.engine.policy.commands import COMMANDS
from mav_tasks.engine.policy.messages import MESSAGES
from mav_tasks.mavlink import messages as m
from mav_tasks.settings import ROLES

#: of dialects that are not generated for us: names of what rovers may understand all the same
NAMES = {
    number: entry.name
    for number, entry in ardupilotmega.enums["MAV_CMD"].items()
    if not entry.name.endswith("ENUM_END")
}
ENVELOPES = {m.CommandInt.id, m.CommandLong.id}  # judged by the command in them


def test_what_is_not_named_is_the_most_dangerous_thing() -> None:
    tasks = (54004, 54020, 54049)  # set aside, without a meaning yet
    rows = [row_of_message(number) for number in (75, 76, 0x7777, 0xFFFFFF)]
    for row in (*map(row_of_command, (0, 15, 53999, 54050, 65535, *tasks)), *rows):
        passes = row.passes_under_stop, row.passes_beside_task
        assert (row.kind, row.role, *passes) == (Kind.MOTION, OPERATOR, False, False), row
    assert all(is_task_command(number) and row_of_command(number).is_claimed for number in tasks)


def test_every_message_and_command_of_mavlink_was_judged_and_has_its_name() -> None:
    assert set(m.ALL) - set(MESSAGES) == ENVELOPES
    assert set(NAMES) <= set(COMMANDS)
    here = {number: f"MAV_CMD_{row.name}" for number, row in COMMANDS.items() if number in NAMES}
    assert here == {number: NAMES[number] for number in here}
    for messages in (m.ALL, ardupilotmega.mavlink_map):
        names = {number: row.name for number, row in MESSAGES.items() if number in messages}
        assert names == {number: messages[number].msgname for number in names}


def problems(row: Row) -> list[str]:
    may_be_asked = row.kind not in (Kind.GO, Kind.MOTION, Kind.STICKS)
    on, harmless = row.passed_on, (Kind.HALT, Kind.QUESTION, Kind.TELL)
    rules = {
        "no role": row.role in ROLES,
        "no words": row.name and row.about,
        "bound, and not for safety": not row.is_bound or row.role == SAFETY,
        "a grant for what moves nothing": not row.needs_grant or row.kind is Kind.MOTION,
        "an observer may move it": row.role != OBSERVER or may_be_asked,
        "a submitter reaches the rover itself": row.role != SUBMITTER or row.is_claimed,
        "passed on to ourselves": not on.is_claimed,
        "passed on for everybody": on.role in (OPERATOR, SAFETY) or on.kind in harmless,
    }
    return [name for name, holds in rules.items() if not holds]


def test_each_row_is_sane() -> None:
    rows = (*COMMANDS.values(), *MESSAGES.values())
    assert {row.name: problems(row) for row in rows if problems(row)} == {}
