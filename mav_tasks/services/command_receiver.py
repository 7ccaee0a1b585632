"""Commands of clients and their answers, as values (MAVLink guide, "Command Protocol").

The very same packet again is given the same answer (``engine/clients/sender.py``); which
submissions are the same task is the task domain's to say (``tasks/deduplicator.py``).
"""

from typing import NamedTuple, TypeGuard

from mav_tasks.mavlink.address import Address, address_of
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.messages import CommandInt, CommandLong, Message

SAME_PACKET = 5.0  # s, the very same packet again: the same answer
REPEATED = 2.5  # s in which a client repeats what it has no answer to, MAVSDK at 0.5, 1.0 and 1.5
COPIED = 3.5  # s after a copy in which the next one comes: QGroundControl waits 3 s for an answer
DOUBLED = 30.0  # s, the same for what is a copy beyond doubt: a net may hold it for long


class Command(NamedTuple):
    """COMMAND_LONG or COMMAND_INT, on one footing.

    ``params`` are param1–param7; of a COMMAND_INT, 5 and 6 are its x and y as plain integers.
    ``frame`` is None for a COMMAND_LONG.
    """

    target: Address
    command: int
    params: tuple[float, float, float, float, float, float, float]
    confirmation: int
    frame: int | None
    message: CommandLong | CommandInt


#: of a command that came in none, and to make one for each takes its time
NO_MESSAGE = CommandInt(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def command_of(message: CommandLong | CommandInt) -> Command:
    target = address_of(message.target_system, message.target_component)
    first = (message.param1, message.param2, message.param3, message.param4)
    if isinstance(message, CommandInt):
        last = (float(message.x), float(message.y), message.z)
        return Command(target, message.command, first + last, 0, message.frame, message)
    last = (message.param5, message.param6, message.param7)
    return Command(target, message.command, first + last, message.confirmation, None, message)


def is_stop(message: Message | None) -> TypeGuard[CommandLong | CommandInt]:
    """Whether a message stops a vehicle; that others have a field for a command means nothing."""
    return isinstance(message, CommandLong | CommandInt) and message.command == MavCmd.TASK_STOP


class Answer(NamedTuple):
    """How a command was answered: everything of the ack but to whom."""

    command: int
    result: int
    result_param2: int
    source: Address
    result_param1: int = 0  # the ack's field ``progress``
