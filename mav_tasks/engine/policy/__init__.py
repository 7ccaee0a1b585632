"""Who may send what, and what of it goes on to a rover: the one table that this is decided from.

Pure. ``row_of_command`` and ``row_of_message`` know a number only; ``row_of`` looks at what is
said, too. It is printed into dialects/README.md by tools/policy_table.py.
"""

from dataclasses import replace

from mav_tasks.engine.policy.commands import (
    COMMANDS,
    DISARM,
    PAUSE,
    PAUSE_HERE,
    TASK_COMMANDS,
)
from mav_tasks.engine.policy.messages import BOUNDING_PLAN, GO_TO_ITEM, MESSAGES, READ_FILE
from mav_tasks.engine.policy.row import UNKNOWN, Kind, Row
from mav_tasks.mavlink import messages as m
from mav_tasks.services import file_transfer

__all__ = [
    "DISARM",
    "GO_TO",
    "PAUSE",
    "PAUSE_HERE",
    "TASK_COMMANDS",
    "Kind",
    "Row",
    "is_task_command",
    "row_of",
    "row_of_command",
    "row_of_message",
]

#: MISSION_ITEM.current: go there now, at once or to this altitude; of ArduPilot
GO_TO = (2, 3)
_NOT_THERE_YET = replace(UNKNOWN, is_claimed=True)


def is_task_command(number: int) -> bool:
    """Whether a command is one of those set aside for tasks, there yet or not."""
    return number in TASK_COMMANDS


def row_of_command(number: int) -> Row:
    """Return the row of a command by its number: of the most that it can be."""
    row = COMMANDS.get(number)
    return row or (_NOT_THERE_YET if is_task_command(number) else UNKNOWN)


def row_of_message(message_id: int) -> Row:
    """Return the row of a message by its number."""
    return MESSAGES.get(message_id, UNKNOWN)


def row_of(message_id: int, message: m.Message | None) -> Row:
    """Return the row of a message by what it says; None is of no known kind, and unverified."""
    if isinstance(message, m.FileTransferProtocol) and file_transfer.reads(message):
        return READ_FILE
    if isinstance(message, m.MissionItem | m.MissionItemInt) and message.current in GO_TO:
        return GO_TO_ITEM
    row = MESSAGES.get(message_id, UNKNOWN)
    is_written = row.kind is Kind.WISH and getattr(message, "mission_type", 0) != 0
    return BOUNDING_PLAN if is_written else row
