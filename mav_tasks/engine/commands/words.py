"""Classifies a command or message by its content: whether it halts a rover or lets it go."""

from mav_tasks.engine.commands.goals import has_place
from mav_tasks.engine.policy import (
    COMMANDS,
    DISARM,
    PAUSE,
    PAUSE_HERE,
    Kind,
    Row,
    row_of_command,
)
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.services.command_receiver import REPEATED, Command
from mav_tasks.services.persona import Persona

#: commands whose parameters decide their row
AMBIGUOUS = frozenset({MavCmd.COMPONENT_ARM_DISARM, MavCmd.DO_PAUSE_CONTINUE, MavCmd.DO_REPOSITION})
SET_MODE = int(MavCmd.DO_SET_MODE)
#: commands that end tasks: a copy must not end later ones
OF_ONE_TASK = (MavCmd.TASK_CANCEL, MavCmd.TASK_CLEAR)


def row_said(command: Command) -> Row:
    """Return the row of a command by its content; ``ModeRequests`` looks closer at modes."""
    if command.command in AMBIGUOUS:
        match command.command, command.params[0]:
            case MavCmd.COMPONENT_ARM_DISARM, 0.0:
                return DISARM
            case MavCmd.DO_PAUSE_CONTINUE, 0.0:
                return PAUSE
            case MavCmd.DO_REPOSITION, _ if not has_place(command):
                return PAUSE_HERE
    return COMMANDS.get(command.command) or row_of_command(command.command)


def kind_of(command: Command, row: Row, persona: Persona) -> Kind:
    """Return the kind of a command with this row; HOLD is a HALT, any other mode a GO."""
    if command.command != SET_MODE:
        return row.kind
    return Kind.HALT if persona.mode_in(*command.params[1:3]) == persona.hold_mode else Kind.GO


def halts_again(command: Command, persona: Persona, *, after: float) -> bool:
    """Whether a command is executed again when the same packet comes ``after`` so many seconds.

    Every halt is: some senders do not count their packets, so it may be a new command. TASK_CANCEL
    by id is not, as it means one task. TASK_CANCEL without an id and TASK_CLEAR are executed again
    after REPEATED seconds, when they mean other tasks.
    """
    if command.command in OF_ONE_TASK:
        is_by_id = command.command == MavCmd.TASK_CANCEL and command.params[0] != 0.0
        return after > REPEATED and not is_by_id
    return kind_of(command, row_said(command), persona) is Kind.HALT
