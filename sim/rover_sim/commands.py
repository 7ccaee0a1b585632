"""The command protocol, vehicle side: answers COMMAND_LONG and COMMAND_INT.

MAVLink guide, "Command Protocol": exactly one COMMAND_ACK each, progress and result_param2 always
0, addressed to the sender. There is no de-duplication: a repeat is executed again. The persona's
table has the effect of each command.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavResult
from rover_sim.dispatch import Handler
from rover_sim.flight import FlightControl
from rover_sim.geo import Origin
from rover_sim.mission_storage import MissionStorage
from rover_sim.outbox import Outbox
from rover_sim.streams import Streams
from rover_sim.timing import Departures

DO_SET_MISSION_CURRENT = 224  # MAV_CMD


class Command(NamedTuple):
    """The fields of COMMAND_LONG or COMMAND_INT that the actions need."""

    params: tuple[float, float, float, float]
    place: tuple[int, int] | None  # x, y of COMMAND_INT; None from COMMAND_LONG
    degrees: tuple[float, float] | None  # param5, param6 of COMMAND_LONG; None from COMMAND_INT
    frame: int
    altitude: float = 0.0  # param7, z of COMMAND_INT


#: a result of None has no answer
Action = Callable[[Command, float], MavResult | None]


@dataclass(frozen=True, slots=True)
class CommandParts:
    """The parts of an autopilot that commands act on."""

    origin: Origin
    flight: FlightControl
    missions: MissionStorage
    streams: Streams
    outbox: Outbox
    send_now: Callable[[int, float], bool]  # a message by id; False if unknown
    reboot: Callable[[float], None]
    modes: tuple[messages.AvailableModes, ...]  # the modes on offer; empty: this make sends no list


class CommandTable(NamedTuple):
    """One make's actions by MAV_CMD, and its answer to SET_MODE."""

    actions: Mapping[int, Action]
    set_mode: Callable[[int, int, float], MavResult]  # base_mode, custom_mode, now
    set_mode_acked_as: int  # the command id in the COMMAND_ACK of the message SET_MODE


class CommandReceiver:
    """Answers commands from a table."""

    def __init__(self, table: CommandTable, outbox: Outbox, departures: Departures) -> None:
        self._table = table
        self._outbox = outbox
        self._departures = departures
        self.handlers: Mapping[int, Handler] = {
            messages.CommandLong.id: self._handle_long,
            messages.CommandInt.id: self._handle_int,
            messages.SetMode.id: self._handle_set_mode,
        }

    def __repr__(self) -> str:
        return f"CommandReceiver({len(self._table.actions)} commands)"

    def _handle_long(self, message: messages.CommandLong, sender: Address, now: float) -> None:
        degrees = (message.param5, message.param6)
        params = _first_four(message)
        command = Command(params, None, degrees, frame=0, altitude=message.param7)
        self._answer(message.command, command, sender, now)

    def _handle_int(self, message: messages.CommandInt, sender: Address, now: float) -> None:
        place = (message.x, message.y)
        params = _first_four(message)
        command = Command(params, place, None, frame=message.frame, altitude=message.z)
        self._answer(message.command, command, sender, now)

    def _handle_set_mode(self, message: messages.SetMode, sender: Address, now: float) -> None:
        """Answer the deprecated message SET_MODE with a COMMAND_ACK, as autopilots do."""
        result = self._table.set_mode(message.base_mode, message.custom_mode, now)
        self._ack(self._table.set_mode_acked_as, result, sender, now)

    def _answer(self, number: int, command: Command, sender: Address, now: float) -> None:
        action = self._table.actions.get(number)
        result = action(command, now) if action else MavResult.UNSUPPORTED
        if result is not None:
            self._ack(number, result, sender, now)

    def _ack(self, command: int, result: MavResult, sender: Address, now: float) -> None:
        ack = messages.CommandAck(command, result, 0, 0, *sender)
        self._outbox.send_at(ack, self._departures.answer_at(now=now), now=now)


def _first_four(
    message: messages.CommandLong | messages.CommandInt,
) -> tuple[float, float, float, float]:
    return (message.param1, message.param2, message.param3, message.param4)


def as_id(value: float) -> int:
    """Return the message id in a float parameter; -1 if it cannot be one (NaN, for example)."""
    return int(value) if 0 <= value <= 0xFFFFFF else -1
