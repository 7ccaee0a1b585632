"""How ArduPilot Rover executes commands, as observed on 4.6.3."""

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavCmd, MavModeFlag, MavResult
from rover_sim.commands import (
    DO_SET_MISSION_CURRENT,
    Command,
    CommandParts,
    CommandTable,
)
from rover_sim.home_command import HomeCommand
from rover_sim.message_commands import MessageCommands
from rover_sim.modes import Mode
from rover_sim.outputs import ardupilot_outputs
from rover_sim.setpoints import GLOBAL_FRAMES, read_place

FORCE_ARM = 2989.0  # param2 of COMPONENT_ARM_DISARM, ArduPilot's magic numbers
FORCE_ARM_OR_DISARM = 21196.0
CHANGE_MODE = 1  # MAV_DO_REPOSITION_FLAGS
REBOOT, REBOOT_TO_BOOTLOADER = 1.0, 3.0


def ardupilot_commands(parts: CommandParts) -> CommandTable:
    """Return the table of commands of ArduPilot Rover."""
    commands = ArduPilotCommands(parts)
    asking = MessageCommands(
        parts,
        unknown_message=MavResult.FAILED,
        bad_interval=MavResult.DENIED,
        bad_interval_text="No ap_message for mavlink id ({})",
        by_index={},
    )
    return CommandTable(
        actions={
            **asking.actions(),
            **ardupilot_outputs(parts.outbox),
            **HomeCommand(parts, MavResult.FAILED, nowhere_is_here=True).actions(),
            MavCmd.COMPONENT_ARM_DISARM: commands.arm_disarm,
            MavCmd.DO_SET_MODE: commands.do_set_mode,
            MavCmd.NAV_RETURN_TO_LAUNCH: commands.return_to_launch,
            MavCmd.MISSION_START: commands.start_mission,
            MavCmd.DO_REPOSITION: commands.reposition,
            MavCmd.DO_CHANGE_SPEED: commands.change_speed,
            DO_SET_MISSION_CURRENT: commands.set_mission_current,
            MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: commands.reboot_shutdown,
        },
        set_mode=commands.set_mode,
        set_mode_acked_as=messages.SetMode.id,  # observed
    )


class ArduPilotCommands:
    """The actions; each takes a command and ``now`` and returns the command's result."""

    def __init__(self, parts: CommandParts) -> None:
        self._parts = parts
        self._flight = parts.flight

    def __repr__(self) -> str:
        return f"ArduPilotCommands({self._flight!r})"

    def arm_disarm(self, command: Command, now: float) -> MavResult:
        """Arm or disarm; both magic numbers force arming."""
        arm, force = command.params[:2]
        if arm == 1.0:
            forced = force in (FORCE_ARM, FORCE_ARM_OR_DISARM)
            return _done(self._flight.arm(forced=forced, now=now))
        if arm == 0.0:
            self._flight.set_armed(False)
            return MavResult.ACCEPTED
        return MavResult.UNSUPPORTED

    def do_set_mode(self, command: Command, now: float) -> MavResult:
        """Change the mode; param2 is HEARTBEAT.custom_mode."""
        base_mode, custom_mode = command.params[:2]
        if not (0 <= base_mode <= 255 and 0 <= custom_mode <= 0xFFFFFFFF):  # NaN fails, too
            return MavResult.DENIED
        return self.set_mode(int(base_mode), int(custom_mode), now)

    def set_mode(self, base_mode: int, custom_mode: int, now: float) -> MavResult:
        """Change the mode from SET_MODE's fields."""
        if not base_mode & MavModeFlag.CUSTOM_MODE_ENABLED:
            return MavResult.DENIED
        return _done(self._flight.request_custom_mode(custom_mode, now=now))

    def return_to_launch(self, _command: Command, now: float) -> MavResult:
        """Enter RTL."""
        return _done(self._flight.request_mode(Mode.RTL, now=now))

    def start_mission(self, command: Command, now: float) -> MavResult:
        """Enter AUTO; deny any first and last item but 0."""
        if command.params[:2] != (0.0, 0.0):
            return MavResult.DENIED
        return _done(self._flight.request_mode(Mode.AUTO, now=now))

    def reposition(self, command: Command, now: float) -> MavResult:
        """Drive to a place in GUIDED; accept COMMAND_INT only."""
        if command.place is None:
            return MavResult.UNSUPPORTED
        destination = read_place(*command.place, self._parts.origin)
        if command.frame not in GLOBAL_FRAMES or destination is None:
            return MavResult.DENIED
        if not self._flight.can_reposition and command.params[1] != CHANGE_MODE:
            return MavResult.DENIED
        return _done(self._flight.reposition(destination, now=now))

    def change_speed(self, command: Command, _now: float) -> MavResult:
        """Change the speed at which GUIDED drives to a place."""
        return _done(self._flight.change_speed(command.params[1]))

    def set_mission_current(self, command: Command, _now: float) -> MavResult:
        """Continue with another mission item."""
        seq = command.params[0]
        if not 0 <= seq <= 65535:
            return MavResult.DENIED
        self._flight.skip_to_item(int(seq))
        return MavResult.ACCEPTED

    def reboot_shutdown(self, command: Command, now: float) -> MavResult:
        """Restart; refuse while armed."""
        if command.params[0] not in (REBOOT, REBOOT_TO_BOOTLOADER):
            return MavResult.UNSUPPORTED
        if self._flight.armed:
            return MavResult.FAILED
        self._parts.reboot(now)
        return MavResult.ACCEPTED


def _done(success: bool) -> MavResult:
    return MavResult.ACCEPTED if success else MavResult.FAILED
