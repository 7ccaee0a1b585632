"""Commands of one client: told apart from their own repeats, and answered exactly once each.

MAVLink guide, "Command Protocol". The very same packet again is given the same answer; which
submissions are the same task is the task domain's to say (``tasks/deduplicator.py``).
"""

from collections import OrderedDict
from collections.abc import Iterator
from typing import NamedTuple, TypeGuard

from mav_tasks.mavlink.address import Address, address_of
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandInt, CommandLong, Message

SAME_PACKET = 5.0  # s, the very same packet again: the same answer
REPEATED = 2.5  # s in which a client repeats what it has no answer to, MAVSDK at 0.5, 1.0 and 1.5
COPIED = 3.5  # s after a copy in which the next one comes: QGroundControl waits 3 s for an answer
DOUBLED = 30.0  # s, the same for what is a copy beyond doubt: a net may hold it for long
REMEMBERED = 256  # packets of one endpoint


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

    def ack(self, to: Address) -> CommandAck:
        first, second = self.result_param1, self.result_param2
        return CommandAck(self.command, self.result, first, second, *to)


class Pending:
    """A command taken in; ``answer`` is None until it has been answered.

    ``is_held``: the answer is known, and waits until the halt is kept; ``words`` follow it.
    """

    __slots__ = ("answer", "at", "command", "is_held", "receiver", "words")

    def __init__(
        self, command: Command, at: float, receiver: "CommandReceiver | None" = None
    ) -> None:
        self.command = command
        self.at = at
        self.receiver = receiver
        self.answer: Answer | None = None
        self.is_held = False
        self.words: tuple[str, Address] | None = None


class CommandReceiver:
    """The memory of one client's commands, which several at one endpoint may share."""

    def __init__(
        self, packets: OrderedDict[bytes, Pending] | None = None, *, most: int = REMEMBERED
    ) -> None:
        """``most``: packets that are remembered."""
        self._packets = OrderedDict() if packets is None else packets
        self._most = most

    def same_packet(self, packet: bytes, *, now: float) -> Pending | None:
        """Return the command that this very packet brought in before."""
        pending = self._packets.get(packet)
        if pending is not None and now - pending.at <= SAME_PACKET:
            return pending
        return None

    def remember(self, command: Command, packet: bytes, *, now: float) -> Pending:
        """Remember a command; return the same packet's before if its answer is held still."""
        known = self._packets.pop(packet, None)
        pending = known if known is not None and known.is_held else Pending(command, now, self)
        self._packets[packet] = pending
        if len(self._packets) > self._most:
            self._packets.popitem(last=False)
        return pending

    def answer_to_copy(self, command: Command, *, now: float) -> Answer | None:
        """Return how an equal command was accepted, so lately that this may be a repeat of it."""
        for pending in self._equals(command, within=REPEATED, now=now):
            if pending.answer is not None and pending.answer.result == MavResult.ACCEPTED:
                return pending.answer
        return None

    def answer_to_counted_copy(self, command: Command, *, now: float) -> Answer | None:
        """Return how an equal command was answered of which this one says that it is a copy.

        A copy says so by a ``confirmation`` above 0; each one keeps the memory of the first alive.
        """
        if command.confirmation == 0:
            return None
        for pending in self._equals(command, within=COPIED, now=now):
            if pending.answer is not None:
                return pending.answer
        return None

    def is_refused_again(self, command: Command, *, within: float, now: float) -> bool:
        """Whether an equal command was refused in the last so many seconds."""
        return any(
            pending.answer is not None and pending.answer.result != MavResult.ACCEPTED
            for pending in self._equals(command, within=within, now=now)
        )

    def older_copy(self, command: Command, *, before: float, now: float) -> bool:
        """Whether an equal command came before ``before``, so lately that this may be a repeat of
        it whose ack was lost, or has yet to be sent."""
        return any(
            pending.at < before
            and (pending.answer is None or pending.answer.result == MavResult.ACCEPTED)
            for pending in self._equals(command, within=COPIED, now=now)
        )

    def _equals(self, command: Command, *, within: float, now: float) -> Iterator[Pending]:
        """Yield the equal commands of the last so many seconds, the latest first."""
        for pending in reversed(self._packets.values()):
            is_recent = pending.receiver is self and now - pending.at <= within
            if is_recent and _equal(pending.command, command):
                yield pending


def _equal(one: Command, other: Command) -> bool:
    """Whether two commands ask for the same; NaN parameters are equal to NaN."""
    return (one.target, one.command, one.frame) == (
        other.target,
        other.command,
        other.frame,
    ) and all(a == b or (a != a and b != b) for a, b in zip(one.params, other.params, strict=True))
