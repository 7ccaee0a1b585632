"""The policy table: which role may send which message or command, and what goes on to a rover.

All such decisions come from it. Pure. ``row_of_command`` and ``row_of_message`` know the number
only; ``row_of`` looks at the content, too. tools/policy_table.py prints it.
"""

from dataclasses import replace

from mav_tasks.engine.policy.commands import (
    COMMANDS,
    DISARM,
    PAUSE,
    PAUSE_HERE,
    TASK_COMMANDS,
    UNKNOWN,
    Kind,
    Row,
)
from mav_tasks.engine.policy.messages import BOUNDING_PLAN, GO_TO_ITEM, MESSAGES, READ_FILE
from mav_tasks.engine.services import file_transfer
from mav_tasks.mavlink import messages as m

__all__ = [
    "COMMANDS",
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

#: MISSION_ITEM.current of ArduPilot: go to this place now, or to this altitude
GO_TO = (2, 3)
_NOT_THERE_YET = replace(UNKNOWN, is_claimed=True)


def is_task_command(number: int) -> bool:
    """Whether a command number is reserved for tasks, in use or not."""
    return number in TASK_COMMANDS


def row_of_command(number: int) -> Row:
    """Return the row of a command by its number: the most dangerous that it can be."""
    return COMMANDS.get(number) or (_NOT_THERE_YET if is_task_command(number) else UNKNOWN)


def row_of_message(message_id: int) -> Row:
    return MESSAGES.get(message_id, UNKNOWN)


def row_of(message_id: int, message: m.Message | None) -> Row:
    """Return the row of a message by its content; ``message`` None: unknown and unverified."""
    if isinstance(message, m.FileTransferProtocol) and file_transfer.reads(message):
        return READ_FILE
    if isinstance(message, m.MissionItem | m.MissionItemInt) and message.current in GO_TO:
        return GO_TO_ITEM
    row = MESSAGES.get(message_id, UNKNOWN)
    is_written = row.kind is Kind.WISH and getattr(message, "mission_type", 0) != 0
    return BOUNDING_PLAN if is_written else row
