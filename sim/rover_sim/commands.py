"""The command protocol, vehicle side: answers COMMAND_LONG and COMMAND_INT.

MAVLink guide, "Command Protocol": exactly one COMMAND_ACK each, progress and result_param2 always
0, addressed to the sender. There is no de-duplication: a repeat is executed again. The persona's
table ``commands`` names the method of ``Commands`` for each command, with its argument if any, or
its fixed result, and ``results`` the results of what a make refuses in its own way.
"""

import math
from collections.abc import Callable

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavModeFlag, MavResult, MavSeverity
from rover_sim.geo import is_on_earth
from rover_sim.modes import Mode
from rover_sim.onboard import Onboard
from rover_sim.setpoints import GLOBAL_FRAMES, Destination, read_place

ACCEPTED, DENIED, UNSUPPORTED = MavResult.ACCEPTED, MavResult.DENIED, MavResult.UNSUPPORTED
CHANGE_MODE = 1  # MAV_DO_REPOSITION_FLAGS
NOT_GIVEN = 0x7FFFFFFF  # x and y of COMMAND_INT: INT32_MAX stands for NaN
NOTHING, REBOOT, REBOOT_TO_BOOTLOADER = 0.0, 1.0, 3.0  # param1 of PREFLIGHT_REBOOT_SHUTDOWN
AUTO = 4  # PX4's main mode; without a sub mode it is the mission
HERE = 1.0  # param1 of DO_SET_HOME
DRIVEN = 1.0, 3.0  # channels of steering and throttle
CHANNELS = 16


Command = messages.CommandLong | messages.CommandInt
Outcome = MavResult | bool


class Commands:
    """The actions; each takes a command and returns its result, or whether it is done."""

    def __init__(
        self, on: Onboard, send: Callable[[int], bool], restart: Callable[[], None]
    ) -> None:
        """``send`` sends a message by its id; it returns False if the make has no such message."""
        self._on = on
        self._restart = restart
        self._flight = on.flight
        self._send = send
        self._results = on.persona.results

    def execute(self, command: Command) -> MavResult | None:
        """Execute a command; return None if it has no answer."""
        action = self._on.persona.commands.get(command.command, UNSUPPORTED.name)
        if not action:
            return None
        if action in MavResult.__members__:
            return MavResult[action]
        name, *words = action.split()
        return self.result_of(getattr(self, name)(command, *words))

    def result_of(self, outcome: Outcome) -> MavResult:
        """Return the result that an action means."""
        if isinstance(outcome, MavResult):
            return outcome
        return ACCEPTED if outcome else self._results["not_done"]

    def set_mode(self, base_mode: int, custom_mode: int) -> Outcome:
        """Change the mode from SET_MODE's fields."""
        if not base_mode & MavModeFlag.CUSTOM_MODE_ENABLED:
            return DENIED
        return self._flight.request_custom_mode(custom_mode)

    def arm_disarm(self, command: Command) -> Outcome:
        """Arm or disarm; a ground vehicle can be disarmed at any time."""
        arm, force = command.param1, command.param2
        if arm == 1.0:
            return self._flight.arm(forced=force in self._on.persona.force_arm)
        if arm != 0.0:
            return UNSUPPORTED
        self._flight.set_armed(False)
        return True

    def set_custom_mode(self, command: Command) -> Outcome:
        """Change the mode; param2 is HEARTBEAT.custom_mode."""
        base_mode, custom_mode = command.param1, command.param2
        if not (0 <= base_mode <= 255 and 0 <= custom_mode <= 0xFFFFFFFF):  # NaN fails, too
            return DENIED
        return self.set_mode(int(base_mode), int(custom_mode))

    def set_main_mode(self, command: Command) -> Outcome:
        """Change the mode; param2 is the main mode, param3 the sub mode."""
        base_mode, main, sub = command.param1, command.param2, command.param3
        sub = 0.0 if math.isnan(sub) else sub
        if not all(0 <= value <= 255 for value in (base_mode, main, sub)):  # NaN fails, too
            return DENIED
        if int(main) == AUTO and not sub:  # as its commander does
            return self._flight.request_mode(Mode.AUTO)
        return self.set_mode(int(base_mode), int(main) << 16 | int(sub) << 24)

    def set_standard_mode(self, command: Command) -> Outcome:
        """Change to a MAV_STANDARD_MODE."""
        number = as_id(command.param1)
        offered = self._on.persona.offered_modes if number else ()
        mode = next((each.mode for each in offered if each.standard == number), None)
        return MavResult.FAILED if mode is None else self._flight.request_mode(mode)

    def enter(self, _command: Command, mode: str) -> Outcome:
        """Enter the mode with this name."""
        return self._flight.request_mode(Mode(mode))

    def refuse_to_fly(self, _command: Command) -> Outcome:
        """Refuse takeoff and landing: a rover has no mode for them."""
        self._on.outbox.say(MavSeverity.CRITICAL, "A rover neither takes off nor lands")
        return MavResult.TEMPORARILY_REJECTED

    def start_auto(self, command: Command) -> Outcome:
        """Enter AUTO; deny any first and last item but 0."""
        if command.param1 != 0.0 or command.param2 != 0.0:
            return DENIED
        return self._flight.request_mode(Mode.AUTO)

    def start_mission(self, command: Command) -> Outcome:
        """Enter MISSION at an item (-1: the present one), and arm."""
        first, missions = command.param1, self._on.missions
        if missions.route() is None:
            text = "Mission start denied! No valid mission"
            self._on.outbox.say(MavSeverity.CRITICAL, text)
            return DENIED
        if not -1 <= first < missions.item_count:  # NaN fails, too
            return DENIED
        if first >= 0:
            self._flight.skip_to_item(int(first))
        started = self._flight.request_mode(Mode.AUTO)
        return started and self._flight.arm(forced=False)

    def go_to(self, command: Command) -> Outcome:
        """Drive to a place in GUIDED; accept COMMAND_INT only."""
        if not isinstance(command, messages.CommandInt):
            return UNSUPPORTED
        place = read_place(command.x, command.y, self._on.origin)
        if command.frame not in GLOBAL_FRAMES or place is None:
            return DENIED
        if not self._flight.can_reposition and command.param2 != CHANGE_MODE:
            return DENIED
        return self._flight.reposition(place)

    def reposition(self, command: Command) -> Outcome:
        """Drive to a place in HOLD, from either form of the command; without a place stay here.

        "Stay here" needs NaN in place, heading and altitude: with a number in heading or altitude,
        the navigator of 1.17 keeps its present destination (navigator_main.cpp, DO_REPOSITION).
        Without CHANGE_MODE the commander answers UNSUPPORTED, but the navigator obeys.
        """
        changes_mode, flight = command.param2 == CHANGE_MODE, self._flight
        if not changes_mode and not (flight.can_reposition and flight.armed):
            return UNSUPPORTED
        place = place_of(command)
        altitude = command.param7 if isinstance(command, messages.CommandLong) else command.z
        if place is None:
            keeps = math.isfinite(command.param4) or math.isfinite(altitude)
            done = flight.reposition(None, keeps_place=keeps)
            return done if changes_mode else UNSUPPORTED
        if not is_on_earth(*place):
            return DENIED
        latitude, longitude = map(round, place)
        done = flight.reposition(Destination(*self._on.origin.to_local(latitude, longitude)))
        return done if changes_mode else UNSUPPORTED

    def change_speed(self, command: Command) -> Outcome:
        """Change the speed of the modes that drive by themselves."""
        return self._flight.change_speed(command.param2) or self._results["bad_speed"]

    def set_mission_current(self, command: Command) -> Outcome:
        """Continue with another mission item."""
        seq = command.param1
        return (0 <= seq <= 65535 and self._flight.skip_to_item(int(seq))) or DENIED

    def reboot_shutdown(self, command: Command) -> Outcome:
        """Restart; refuse while armed."""
        what = command.param1
        if what not in (REBOOT, REBOOT_TO_BOOTLOADER):
            return self._results["reboot_nothing" if what == NOTHING else "reboot_other"]
        if self._flight.armed:
            return self._results["reboot_armed"]
        self._restart()
        return True

    def set_home(self, command: Command) -> Outcome:
        """Set home to a place or to the rover's position. From the sources, not observed.

        The altitude is ignored: the world is flat.
        """
        given, takes_zeros = place_of(command), self._on.persona.home.nowhere_is_here
        x, y = map(round, given) if given and is_on_earth(*given) else (NOT_GIVEN, NOT_GIVEN)
        if command.param1 == HERE or (takes_zeros and x == y == 0):
            self._flight.set_home(None)
            return True
        place = read_place(x, y, self._on.origin)
        if place is None:
            return self._results["bad_home"]
        self._flight.set_home(place)
        return True

    # messages on request

    def set_message_interval(self, command: Command) -> Outcome:
        """Change the interval of a message."""
        message_id, interval_us = as_id(command.param1), command.param2
        if self._on.streams.set_interval(message_id, interval_us, self._on.now):
            return True
        text = self._on.persona.texts["bad_interval"]
        self._on.outbox.inform(text.format(message_id))
        return self._results["bad_interval"]

    def get_message_interval(self, command: Command) -> Outcome:
        """Send MESSAGE_INTERVAL of the message in param1."""
        return self._tell_interval(command.param1, MavResult.FAILED)

    def _tell_interval(self, value: float, refusal: MavResult) -> Outcome:
        message_id = as_id(value)
        if message_id < 0:
            return refusal
        interval_us = self._on.streams.interval_us(message_id)
        self._on.outbox.send(messages.MessageInterval(message_id & 0xFFFF, interval_us))
        return True

    def request_message(self, command: Command) -> Outcome:
        """Send the message in param1, once."""
        return self._told(as_id(command.param1))

    def request_any_message(self, command: Command) -> Outcome:
        """Send the message in param1, also one that needs param2."""
        match as_id(command.param1):
            case messages.AvailableModes.id:
                return self._tell_modes(as_id(command.param2))
            case messages.MessageInterval.id:
                return self._tell_interval(command.param2, DENIED)
            case message_id:
                return self._told(message_id)

    def _tell_modes(self, index: int) -> Outcome:
        """Send AVAILABLE_MODES of an index, from 1; 0 sends all of them.

        MAVLink guide, "Standard Modes Protocol". The list never changes here, so there is no
        AVAILABLE_MODES_MONITOR: PX4 sends that only after a first change, and never on request.
        """
        persona = self._on.persona
        offered = persona.offered_modes
        if not 0 <= index <= len(offered):
            return DENIED
        for number, each in enumerate(offered, start=1):
            if index in (0, number):
                mode, name = persona.modes.numbers[each.mode], each.name.encode()
                self._on.outbox.send(
                    messages.AvailableModes(
                        len(offered), number, each.standard, mode, each.properties, name
                    )
                )
        return True

    def tell(self, _command: Command, message: str) -> Outcome:
        """Send the message with this name."""
        return self._told(getattr(messages, message).id)

    def _told(self, message_id: int) -> Outcome:
        return self._send(message_id) or self._results["unknown_message"]

    # outputs: one relay, and servos

    def set_relay(self, command: Command) -> Outcome:
        """Switch the only relay."""
        return command.param1 == 0.0

    def set_servo(self, command: Command) -> Outcome:
        """Set a servo output, unless it drives the rover."""
        channel = command.param1
        if channel in DRIVEN:
            text = f"ServoRelayEvent: Channel {channel:.0f} is already in use"
            self._on.outbox.inform(text)
            return False
        return 1.0 <= channel <= CHANNELS


def place_of(command: Command) -> tuple[float, float] | None:
    """Return latitude and longitude in degE7, unchecked; None if not given."""
    if isinstance(command, messages.CommandInt):
        is_given = (command.x, command.y) != (NOT_GIVEN, NOT_GIVEN)
        return (command.x, command.y) if is_given else None
    degrees = (command.param5, command.param6)
    return None if any(map(math.isnan, degrees)) else (degrees[0] * 1e7, degrees[1] * 1e7)


def as_id(value: float) -> int:
    """Return the message id in a float parameter; -1 if it cannot be one (NaN, for example)."""
    return int(value) if 0 <= value <= 0xFFFFFF else -1
