"""What a client's word does to a rover, by what it says: see ``policy`` for what it may be."""

from mav_tasks.engine.commands.goals import has_place
from mav_tasks.engine.policy import (
    DISARM,
    PAUSE,
    PAUSE_HERE,
    Kind,
    Row,
    row_of_command,
    row_of_message,
)
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.messages import CommandInt, CommandLong, Message, SetMode
from mav_tasks.services.command_receiver import REPEATED, Command, command_of
from mav_tasks.services.persona import Persona

#: the commands that are something else by what they say
AMBIGUOUS = frozenset({MavCmd.COMPONENT_ARM_DISARM, MavCmd.DO_PAUSE_CONTINUE, MavCmd.DO_REPOSITION})
SET_MODE = int(MavCmd.DO_SET_MODE)
#: each of these means one task, whatever copies of it come
OF_ONE_TASK = (MavCmd.TASK_CANCEL, MavCmd.TASK_CLEAR)


def row_said(command: Command) -> Row:
    """Return the row of a command by what it says; of a mode ``ModeRequests`` knows more."""
    if command.command in AMBIGUOUS:
        match command.command, command.params[0]:
            case MavCmd.COMPONENT_ARM_DISARM, 0.0:
                return DISARM
            case MavCmd.DO_PAUSE_CONTINUE, 0.0:
                return PAUSE
            case MavCmd.DO_REPOSITION, _ if not has_place(command):
                return PAUSE_HERE
    return row_of_command(command.command)


def kind_of(command: Command, row: Row, persona: Persona) -> Kind:
    """Return what a command does that has this row."""
    if command.command != SET_MODE:
        return row.kind
    is_hold = persona.mode_in(*command.params[1:3]) == persona.hold_mode
    return Kind.HALT if is_hold else Kind.GO


def kind_of_message(message: Message | None, persona: Persona) -> Kind:
    """Return what a client's message does, as far as its order within a moment matters."""
    if isinstance(message, SetMode):
        return Kind.HALT if message.custom_mode == persona.hold_mode else Kind.GO
    if isinstance(message, CommandLong | CommandInt):
        command = command_of(message)
        return kind_of(command, row_said(command), persona)
    return Kind.WISH if message is None else row_of_message(message.id).kind


def halts_again(command: Command, persona: Persona, *, after: float) -> bool:
    """Whether a copy of a word makes a rover stand, the very same packet ``after`` so many seconds.

    Some senders do not count their packets: it may be another word, and is acknowledged. Who calls
    a task off means that one task; whatever runs, or all of them, are others after a while.
    """
    if command.command in OF_ONE_TASK:
        is_by_id = command.command == MavCmd.TASK_CANCEL and command.params[0] != 0.0
        return after > REPEATED and not is_by_id
    return kind_of(command, row_said(command), persona) is Kind.HALT
