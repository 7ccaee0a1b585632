"""Commands of one client: told apart from their own repeats, and answered exactly once each.

MAVLink guide, "Command Protocol". DEVIATION: a repeat is recognised although ``confirmation``
stays 0, because MAVSDK never counts it up and COMMAND_INT has none. The rules are those of
``dialects/README.md``, "The same task twice".
"""

from collections import OrderedDict
from dataclasses import dataclass
from typing import NamedTuple

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandInt, CommandLong

SAME_PACKET = 5.0  # s, the very same packet again: the same answer (rule 1)
CONFIRMED = 10.0  # s, confirmation > 0 with equal parameters: the same task (rule 3)
SAME_PAYLOAD = 2.5  # s since the last copy, without a nonce: the same task (rule 5)
REMEMBERED = 256  # packets of one client, for rule 1
NONCES = 2_000  # remembered for each client address, for rule 2


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


def command_of(message: CommandLong | CommandInt) -> Command:
    """Give the command that a message carries."""
    target = Address(message.target_system, message.target_component)
    first = (message.param1, message.param2, message.param3, message.param4)
    if isinstance(message, CommandInt):
        last = (float(message.x), float(message.y), message.z)
        return Command(target, message.command, first + last, 0, message.frame, message)
    last = (message.param5, message.param6, message.param7)
    return Command(target, message.command, first + last, message.confirmation, None, message)


class Answer(NamedTuple):
    """How a command was answered: everything of the ack but to whom."""

    command: int
    result: int
    result_param2: int
    source: Address

    def ack(self, to: Address) -> CommandAck:
        """Give the COMMAND_ACK for a client's address."""
        return CommandAck(
            self.command,
            self.result,
            0,
            self.result_param2,
            to.system_id,
            to.component_id,
        )


class Pending:
    """A command taken in; ``answer`` is None until it has been answered."""

    __slots__ = ("answer", "at", "command", "packet")

    def __init__(self, command: Command, packet: bytes, at: float) -> None:
        self.command = command
        self.packet = packet
        self.at = at
        self.answer: Answer | None = None


@dataclass(frozen=True, slots=True)
class Repeat:
    """A command that is the same as one before; ``same_payload`` says that rule 5 found it."""

    first: Pending
    same_payload: bool = False


class NonceReused(Exception):
    """A nonce came again with another payload (rule 2)."""


class CommandReceiver:
    """The memory of one client's commands.

    ``nonces`` is shared by all endpoints of one MAVLink address: a client that comes back from
    another port is still the same.
    """

    def __init__(self, nonces: OrderedDict[int, Pending]) -> None:
        self._packets: OrderedDict[bytes, Pending] = OrderedDict()
        self._last_of_command: dict[int, Pending] = {}
        self._nonces = nonces

    def same_packet(self, packet: bytes, *, now: float) -> Pending | None:
        """Give the command that this very packet brought in before (rule 1)."""
        pending = self._packets.get(packet)
        if pending is not None and now - pending.at <= SAME_PACKET:
            return pending
        return None

    def remember(self, command: Command, packet: bytes, *, now: float) -> Pending:
        """Take a command in, for rule 1."""
        pending = Pending(command, packet, now)
        self._packets.pop(packet, None)
        self._packets[packet] = pending
        if len(self._packets) > REMEMBERED:
            self._packets.popitem(last=False)
        return pending

    def older_copy(self, command: Command, *, before: float, now: float) -> bool:
        """Whether an equal command was carried out before ``before``, so lately that this may be
        a repeat of it whose ack was lost."""
        return any(
            pending.at < before
            and now - pending.at <= SAME_PAYLOAD
            and pending.answer is not None
            and pending.answer.result == MavResult.ACCEPTED
            and _equal(pending.command, command)
            for pending in self._packets.values()
        )

    def same_submission(self, command: Command, *, nonce: int, now: float) -> Repeat | None:
        """Give the submission that this one repeats (rules 2, 3, 5), or None if it is new.

        Raises NonceReused. A submission that was refused is forgotten: it may be tried again.
        """
        if nonce:
            known = self._nonces.get(nonce)
            if known is None:
                return None
            if not _equal(known.command, command):
                raise NonceReused
            return Repeat(known)
        last = self._last_of_command.get(command.command)
        if last is None or not _equal(last.command, command):
            return None
        age = now - last.at
        if command.confirmation > 0 and age <= CONFIRMED:
            return Repeat(last)
        if age <= SAME_PAYLOAD:
            last.at = now
            return Repeat(last, same_payload=True)
        return None

    def remember_submission(self, pending: Pending, *, nonce: int) -> None:
        """Keep a submission that was accepted for processing, for rules 2, 3 and 5."""
        if nonce:
            self._nonces[nonce] = pending
            if len(self._nonces) > NONCES:
                self._nonces.popitem(last=False)
        else:
            self._last_of_command[pending.command.command] = pending

    def forget_submission(self, pending: Pending, *, nonce: int) -> None:
        """Forget a submission that was refused in the end."""
        if self._nonces.get(nonce) is pending:
            del self._nonces[nonce]
        if self._last_of_command.get(pending.command.command) is pending:
            del self._last_of_command[pending.command.command]


def _equal(one: Command, other: Command) -> bool:
    """Whether two commands ask for the same; NaN parameters are equal to NaN."""
    return (one.target, one.command, one.frame) == (
        other.target,
        other.command,
        other.frame,
    ) and all(a == b or (a != a and b != b) for a, b in zip(one.params, other.params, strict=True))
