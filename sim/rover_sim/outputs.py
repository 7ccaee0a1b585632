"""Commands to outputs and cameras, as ArduPilot Rover 4.6.3 and PX4 1.17.0 answer them (SITL)."""

from collections.abc import Mapping

from mav_tasks.mavlink.enums import MavResult, MavSeverity
from rover_sim.commands import Action, Command
from rover_sim.outbox import Outbox

RELAY, SERVO, SHUTTER, GRIPPER, PHOTO, WINCH = 181, 183, 203, 211, 2000, 42600  # MAV_CMD
VIDEO = 2500, 2501
DRIVEN = 1.0, 3.0  # channels of steering and throttle
CHANNELS = 16


def ardupilot_outputs(outbox: Outbox) -> Mapping[int, Action]:
    """Return the actions with one relay and a shutter, and without gripper and camera driver."""

    def relay(command: Command, _now: float) -> MavResult:
        return MavResult.ACCEPTED if command.params[0] == 0.0 else MavResult.FAILED

    def servo(command: Command, _now: float) -> MavResult:
        channel = command.params[0]
        if channel in DRIVEN:
            words = f"ServoRelayEvent: Channel {channel:.0f} is already in use"
            outbox.say(MavSeverity.INFO, words)
            return MavResult.FAILED
        return MavResult.ACCEPTED if 1.0 <= channel <= CHANNELS else MavResult.FAILED

    def accept(_command: Command, _now: float) -> MavResult:
        return MavResult.ACCEPTED

    def fail(_command: Command, _now: float) -> MavResult:
        return MavResult.FAILED

    failing = dict.fromkeys((GRIPPER, PHOTO, *VIDEO), fail)
    return {RELAY: relay, SERVO: servo, SHUTTER: accept, **failing}


def px4_outputs() -> Mapping[int, Action]:
    """Return the actions without any such device: some commands have no answer at all."""

    def ignore(_command: Command, _now: float) -> None:
        return None

    return dict.fromkeys((SHUTTER, GRIPPER, WINCH), ignore)
