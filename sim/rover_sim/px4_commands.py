"""How a PX4 1.15 rover executes commands, after its commander and its MAVLink receiver."""

import math

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavCmd, MavModeFlag, MavResult, MavSeverity
from rover_sim.available_modes import MISSION, SAFE_RECOVERY
from rover_sim.commands import (
    DO_SET_MISSION_CURRENT,
    Command,
    CommandParts,
    CommandTable,
    as_id,
)
from rover_sim.geo import LATITUDE_LIMIT_DEGE7, LONGITUDE_LIMIT_DEGE7
from rover_sim.home_command import HomeCommand
from rover_sim.message_commands import MessageCommands
from rover_sim.modes import Mode
from rover_sim.outputs import px4_outputs
from rover_sim.setpoints import Destination

DO_SET_STANDARD_MODE = 262  # MAV_CMD
STANDARD_MODES = {SAFE_RECOVERY: Mode.RTL, MISSION: Mode.AUTO}  # the others are for aircraft
CHANGE_MODE = 1  # MAV_DO_REPOSITION_FLAGS
NOT_GIVEN = 0x7FFFFFFF  # x and y of COMMAND_INT: INT32_MAX stands for NaN
MISTAKEN_NAN = 0x7FF80000  # a float's NaN that was sent as an integer
AUTO = 4  # main mode; without a sub mode it is the mission
NOTHING, REBOOT, REBOOT_TO_BOOTLOADER = 0.0, 1.0, 3.0  # param1 of PREFLIGHT_REBOOT_SHUTDOWN


def px4_commands(parts: CommandParts) -> CommandTable:
    """Return the table of commands of a PX4 rover."""
    commands = Px4Commands(parts)
    asking = MessageCommands(
        parts,
        unknown_message=MavResult.DENIED,
        bad_interval=MavResult.FAILED,
        bad_interval_text=None,
        by_index={
            messages.AvailableModes.id: commands.send_modes,
            messages.MessageInterval.id: commands.send_interval,
        },
    )
    return CommandTable(
        actions={
            **asking.actions(),
            **px4_outputs(),
            **HomeCommand(parts, MavResult.DENIED, nowhere_is_here=False).actions(),
            MavCmd.COMPONENT_ARM_DISARM: commands.arm_disarm,
            MavCmd.DO_SET_MODE: commands.do_set_mode,
            DO_SET_STANDARD_MODE: commands.do_set_standard_mode,
            MavCmd.NAV_RETURN_TO_LAUNCH: commands.return_to_launch,
            MavCmd.NAV_TAKEOFF: commands.refuse_to_fly,
            MavCmd.NAV_LAND: commands.refuse_to_fly,
            MavCmd.MISSION_START: commands.start_mission,
            MavCmd.DO_REPOSITION: commands.reposition,
            MavCmd.DO_CHANGE_SPEED: commands.change_speed,
            DO_SET_MISSION_CURRENT: commands.set_mission_current,
            MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: commands.reboot_shutdown,
            MavCmd.REQUEST_PROTOCOL_VERSION: commands.request_protocol_version,
        },
        set_mode=commands.set_mode,
        set_mode_acked_as=MavCmd.DO_SET_MODE,
    )


class Px4Commands:
    """The actions; each takes a command and ``now`` and returns the command's result."""

    def __init__(self, parts: CommandParts) -> None:
        self._parts = parts
        self._flight = parts.flight

    def __repr__(self) -> str:
        return f"Px4Commands({self._flight!r})"

    def arm_disarm(self, command: Command, now: float) -> MavResult:
        """Arm or disarm; a ground vehicle can be disarmed at any time."""
        arm = command.params[0]
        if arm == 1.0:
            return _done(self._flight.arm(forced=False, now=now))
        if arm == 0.0:
            self._flight.set_armed(False)
            return MavResult.ACCEPTED
        return MavResult.UNSUPPORTED

    def do_set_mode(self, command: Command, now: float) -> MavResult:
        """Change the mode; param2 is the main mode, param3 the sub mode."""
        base_mode, main, sub = command.params[:3]
        sub = 0.0 if math.isnan(sub) else sub
        if not all(0 <= value <= 255 for value in (base_mode, main, sub)):  # NaN fails, too
            return MavResult.DENIED
        if int(main) == AUTO and not sub:  # as its commander does
            return _done(self._flight.request_mode(Mode.AUTO, now=now))
        return self.set_mode(int(base_mode), int(main) << 16 | int(sub) << 24, now)

    def set_mode(self, base_mode: int, custom_mode: int, now: float) -> MavResult:
        """Change the mode from SET_MODE's fields."""
        if not base_mode & MavModeFlag.CUSTOM_MODE_ENABLED:
            return MavResult.DENIED
        return _done(self._flight.request_custom_mode(custom_mode, now=now))

    def do_set_standard_mode(self, command: Command, now: float) -> MavResult:
        """Change to a MAV_STANDARD_MODE."""
        mode = STANDARD_MODES.get(as_id(command.params[0]))
        if mode is None:
            return MavResult.FAILED
        return _done(self._flight.request_mode(mode, now=now))

    def send_modes(self, command: Command, _now: float) -> MavResult:
        """Send AVAILABLE_MODES of the index in param2, from 1; 0 sends all of them."""
        modes, index = self._parts.modes, as_id(command.params[1])
        if not 0 <= index <= len(modes):
            return MavResult.DENIED
        for message in modes if index == 0 else modes[index - 1 : index]:
            self._parts.outbox.send(message)
        return MavResult.ACCEPTED

    def send_interval(self, command: Command, _now: float) -> MavResult:
        """Send MESSAGE_INTERVAL of the message in param2."""
        message_id = as_id(command.params[1])
        if message_id < 0:
            return MavResult.DENIED
        interval_us = self._parts.streams.interval_us(message_id)
        self._parts.outbox.send(messages.MessageInterval(message_id & 0xFFFF, interval_us))
        return MavResult.ACCEPTED

    def return_to_launch(self, _command: Command, now: float) -> MavResult:
        """Enter RTL."""
        return _done(self._flight.request_mode(Mode.RTL, now=now))

    def refuse_to_fly(self, _command: Command, _now: float) -> MavResult:
        """Refuse takeoff and landing: a rover has no mode for them."""
        self._parts.outbox.say(MavSeverity.CRITICAL, "A rover neither takes off nor lands")
        return MavResult.TEMPORARILY_REJECTED

    def start_mission(self, command: Command, now: float) -> MavResult:
        """Enter MISSION at an item (-1: the present one), and arm."""
        first, missions = command.params[0], self._parts.missions
        if missions.route() is None:
            text = "Mission start denied! No valid mission"
            self._parts.outbox.say(MavSeverity.CRITICAL, text)
            return MavResult.DENIED
        if not -1 <= first < missions.item_count:  # NaN fails, too
            return MavResult.DENIED
        if first >= 0:
            self._flight.skip_to_item(int(first))
        started = self._flight.request_mode(Mode.AUTO, now=now)
        return _done(started and self._flight.arm(forced=False, now=now))

    def reposition(self, command: Command, now: float) -> MavResult:
        """Drive to a place in HOLD, from either form of the command; without a place stay here.

        "Stay here" needs NaN in place, heading and altitude: with a number in heading or altitude,
        the navigator of 1.17 keeps its present destination (navigator_main.cpp, DO_REPOSITION).
        Without CHANGE_MODE the commander answers UNSUPPORTED, but the navigator obeys.
        """
        changes_mode = command.params[1] == CHANGE_MODE
        if not changes_mode and not (self._flight.can_reposition and self._flight.armed):
            return MavResult.UNSUPPORTED
        place = _place(command)
        if place is None:
            keeps = any(map(math.isfinite, (command.params[3], command.altitude)))
            done = self._flight.reposition(None, keeps_place=keeps, now=now)
            return _done(done) if changes_mode else MavResult.UNSUPPORTED
        latitude, longitude = place
        if abs(latitude) > LATITUDE_LIMIT_DEGE7 or abs(longitude) > LONGITUDE_LIMIT_DEGE7:
            return MavResult.DENIED
        destination = Destination(*self._parts.origin.to_local(round(latitude), round(longitude)))
        done = self._flight.reposition(destination, now=now)
        return _done(done) if changes_mode else MavResult.UNSUPPORTED

    def change_speed(self, command: Command, _now: float) -> MavResult:
        """Change the speed of the modes that drive by themselves."""
        changed = self._flight.change_speed(command.params[1])
        return MavResult.ACCEPTED if changed else MavResult.DENIED

    def set_mission_current(self, command: Command, _now: float) -> MavResult:
        """Continue with another mission item."""
        seq = command.params[0]
        if not 0 <= seq <= 65535 or not self._flight.skip_to_item(int(seq)):
            return MavResult.DENIED
        return MavResult.ACCEPTED

    def reboot_shutdown(self, command: Command, now: float) -> MavResult:
        """Restart; deny while armed."""
        if command.params[0] == NOTHING:
            return MavResult.ACCEPTED
        if command.params[0] not in (REBOOT, REBOOT_TO_BOOTLOADER) or self._flight.armed:
            return MavResult.DENIED
        self._parts.reboot(now)
        return MavResult.ACCEPTED

    def request_protocol_version(self, _command: Command, now: float) -> MavResult:
        """Send PROTOCOL_VERSION; without it QGroundControl falls back to MAVLink 1."""
        self._parts.send_now(messages.ProtocolVersion.id, now)
        return MavResult.ACCEPTED


def _place(command: Command) -> tuple[float, float] | None:
    """Return latitude and longitude in degE7, unchecked; None if not given."""
    if command.place is not None:
        return None if command.place == (NOT_GIVEN, NOT_GIVEN) else command.place
    if command.degrees is None or any(math.isnan(value) for value in command.degrees):
        return None
    latitude, longitude = command.degrees
    return latitude * 1e7, longitude * 1e7


def _done(success: bool) -> MavResult:
    return MavResult.ACCEPTED if success else MavResult.TEMPORARILY_REJECTED
