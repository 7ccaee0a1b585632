"""The command protocol, vehicle side: COMMAND_LONG and COMMAND_INT to an answer.

MAVLink guide, "Command Protocol". As Rover 4.6.3: exactly one COMMAND_ACK each, progress and
result_param2 always 0, targeted at the sender; no de-duplication, a repeat is carried out again.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavModeFlag, MavResult, MavSeverity
from rover_sim.dispatch import Handler
from rover_sim.flight import FlightControl
from rover_sim.geo import Origin
from rover_sim.outbox import Outbox
from rover_sim.personas import Mode, Persona
from rover_sim.setpoints import GLOBAL_FRAMES, read_place
from rover_sim.streams import Streams

FORCE_ARM = 2989.0  # param2 of COMPONENT_ARM_DISARM, ArduPilot's magic numbers
FORCE_ARM_OR_DISARM = 21196.0
CHANGE_MODE = 1  # MAV_DO_REPOSITION_FLAGS
NAV_RETURN_TO_LAUNCH = 20
DO_SET_MISSION_CURRENT = 224
REBOOT, REBOOT_TO_BOOTLOADER = 1.0, 3.0


class Command(NamedTuple):
    """Either form of a command, as far as the answers need it."""

    params: tuple[float, float, float, float]
    place: tuple[int, int] | None  # x, y of COMMAND_INT; None from COMMAND_LONG
    frame: int


Either = messages.CommandLong | messages.CommandInt
Action = Callable[[Command, float], MavResult]


class CommandReceiver:
    """Answers commands. What it cannot do itself it asks of the flight control."""

    def __init__(
        self,
        *,
        persona: Persona,
        origin: Origin,
        flight: FlightControl,
        streams: Streams,
        outbox: Outbox,
        send_now: Callable[[int, float], bool],
        reboot: Callable[[float], None],
    ) -> None:
        self._persona = persona
        self._origin = origin
        self._flight = flight
        self._streams = streams
        self._outbox = outbox
        self._send_now = send_now  # a message by id; False if unknown
        self._reboot = reboot
        self._actions: Mapping[int, Action] = {
            MavCmd.COMPONENT_ARM_DISARM: self._arm_disarm,
            MavCmd.DO_SET_MODE: self._set_mode,
            NAV_RETURN_TO_LAUNCH: self._return_to_launch,
            MavCmd.MISSION_START: self._start_mission,
            MavCmd.DO_REPOSITION: self._reposition,
            MavCmd.DO_CHANGE_SPEED: self._change_speed,
            DO_SET_MISSION_CURRENT: self._set_mission_current,
            MavCmd.SET_MESSAGE_INTERVAL: self._set_message_interval,
            MavCmd.GET_MESSAGE_INTERVAL: self._get_message_interval,
            MavCmd.REQUEST_MESSAGE: self._request_message,
            MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: self._request_capabilities,
            MavCmd.GET_HOME_POSITION: self._get_home_position,
            MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: self._reboot_shutdown,
        }
        self.handlers: Mapping[int, Handler] = {
            messages.CommandLong.id: self._handle_long,
            messages.CommandInt.id: self._handle_int,
            messages.SetMode.id: self._handle_set_mode,
        }

    def __repr__(self) -> str:
        return f"CommandReceiver({len(self._actions)} commands)"

    def _handle_long(self, message: messages.CommandLong, sender: Address, now: float) -> None:
        self._answer(message, Command(_first_four(message), None, 0), sender, now)

    def _handle_int(self, message: messages.CommandInt, sender: Address, now: float) -> None:
        place = (message.x, message.y)
        self._answer(message, Command(_first_four(message), place, message.frame), sender, now)

    def _handle_set_mode(self, message: messages.SetMode, sender: Address, _now: float) -> None:
        """The old message, which ArduPilot answers as if it were a command."""
        result = self._mode_result(message.base_mode, message.custom_mode)
        self._ack(messages.SetMode.id, result, sender)

    def _answer(self, message: Either, command: Command, sender: Address, now: float) -> None:
        action = self._actions.get(message.command)
        result = action(command, now) if action else MavResult.UNSUPPORTED
        self._ack(message.command, result, sender)

    def _ack(self, command: int, result: MavResult, sender: Address) -> None:
        self._outbox.send(messages.CommandAck(command, result, 0, 0, *sender))

    def _arm_disarm(self, command: Command, now: float) -> MavResult:
        arm, force = command.params[:2]
        if arm == 1.0:
            forced = force in (FORCE_ARM, FORCE_ARM_OR_DISARM)
            return _done(self._flight.arm(forced=forced, now=now))
        if arm == 0.0:
            self._flight.set_armed(False)
            return MavResult.ACCEPTED
        return MavResult.UNSUPPORTED

    def _set_mode(self, command: Command, _now: float) -> MavResult:
        base_mode, custom_mode = command.params[:2]
        if not (0 <= base_mode <= 255 and 0 <= custom_mode <= 0xFFFFFFFF):  # NaN is not, either
            return MavResult.DENIED
        return self._mode_result(int(base_mode), int(custom_mode))

    def _mode_result(self, base_mode: int, custom_mode: int) -> MavResult:
        if not base_mode & MavModeFlag.CUSTOM_MODE_ENABLED:
            return MavResult.DENIED
        return _done(self._flight.request_mode(custom_mode))

    def _return_to_launch(self, _command: Command, _now: float) -> MavResult:
        return _done(self._flight.request_mode(self._persona.modes[Mode.RTL]))

    def _start_mission(self, command: Command, _now: float) -> MavResult:
        if command.params[:2] != (0.0, 0.0):
            return MavResult.DENIED
        return _done(self._flight.request_mode(self._persona.modes[Mode.AUTO]))

    def _reposition(self, command: Command, now: float) -> MavResult:
        if command.place is None:
            return MavResult.UNSUPPORTED
        destination = read_place(*command.place, self._origin)
        if command.frame not in GLOBAL_FRAMES or destination is None:
            return MavResult.DENIED
        flight, flags = self._flight, command.params[1]
        if flight.mode is not Mode.GUIDED:
            if flags != CHANGE_MODE:
                return MavResult.DENIED
            if not flight.request_mode(self._persona.modes[Mode.GUIDED]):
                return MavResult.FAILED
        flight.guided.go_to(destination, now=now)
        return MavResult.ACCEPTED

    def _change_speed(self, command: Command, _now: float) -> MavResult:
        flight = self._flight
        changed = flight.guided.change_speed(command.params[1])
        return _done(changed and flight.mode is Mode.GUIDED)

    def _set_mission_current(self, command: Command, _now: float) -> MavResult:
        seq = command.params[0]
        if not 0 <= seq <= 65535:
            return MavResult.DENIED
        self._flight.skip_to_item(int(seq))
        return MavResult.ACCEPTED

    def _set_message_interval(self, command: Command, now: float) -> MavResult:
        message_id, interval_us = command.params[:2]
        if self._streams.set_interval(_as_id(message_id), interval_us, now=now):
            return MavResult.ACCEPTED
        self._outbox.say(MavSeverity.INFO, f"No ap_message for mavlink id ({_as_id(message_id)})")
        return MavResult.DENIED

    def _get_message_interval(self, command: Command, _now: float) -> MavResult:
        message_id = _as_id(command.params[0])
        if message_id < 0:
            return MavResult.FAILED
        interval_us = self._streams.interval_us(message_id)
        self._outbox.send(messages.MessageInterval(message_id & 0xFFFF, interval_us))
        return MavResult.ACCEPTED

    def _request_message(self, command: Command, now: float) -> MavResult:
        return _done(self._send_now(_as_id(command.params[0]), now))

    def _request_capabilities(self, _command: Command, now: float) -> MavResult:
        return _done(self._send_now(messages.AutopilotVersion.id, now))

    def _get_home_position(self, _command: Command, now: float) -> MavResult:
        return _done(self._send_now(messages.HomePosition.id, now))

    def _reboot_shutdown(self, command: Command, now: float) -> MavResult:
        if command.params[0] not in (REBOOT, REBOOT_TO_BOOTLOADER):
            return MavResult.UNSUPPORTED
        if self._flight.armed:
            return MavResult.FAILED
        self._reboot(now)
        return MavResult.ACCEPTED


def _first_four(message: Either) -> tuple[float, float, float, float]:
    return (message.param1, message.param2, message.param3, message.param4)


def _done(success: bool) -> MavResult:
    return MavResult.ACCEPTED if success else MavResult.FAILED


def _as_id(value: float) -> int:
    """A message id from a float parameter; -1 for what cannot be one (NaN among them)."""
    return int(value) if 0 <= value <= 0xFFFFFF else -1
