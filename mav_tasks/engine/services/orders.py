"""What is said to one vehicle so that it does what we want, in the way of its persona. Pure."""

from enum import Enum, auto
from math import copysign, cos, isfinite, nan, sin
from typing import NamedTuple

from mav_tasks.engine.services.missions import NOT_GIVEN
from mav_tasks.engine.services.persona import Persona
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame, MavType
from mav_tasks.mavlink.messages import CommandInt, CommandLong, Message, SetPositionTargetLocalNed


class Phase(Enum):
    #: it is not ours; nothing is sent
    IDLE = auto()
    #: a heartbeat is awaited that shows whose it is now
    LOOKING = auto()
    #: HOLD is asked for, to arm in it
    ASKING_HOLD = auto()
    #: arming is asked for, zeros are streamed
    ASKING_ARM = auto()
    #: armed in HOLD; zeros are streamed
    LEADING_IN = auto()
    #: our mode is asked for
    ASKING_MODE = auto()
    #: in our mode and seen armed: setpoints move it
    CONTROL = auto()
    #: standing, HOLD is asked for
    RELEASING = auto()
    #: HOLD seen after a release that disarms; disarming is asked for
    DISARMING = auto()
    #: STOP: zeros and HOLD until confirmed
    STOPPING = auto()


#: nothing of ours is under way that still has to come true
ENDED = frozenset({Phase.IDLE, Phase.RELEASING, Phase.STOPPING})
STREAMING = frozenset({Phase.ASKING_ARM, Phase.LEADING_IN, Phase.CONTROL})


#: others give the mode numbers other meanings
DRIVEN = frozenset({MavType.GROUND_ROVER, MavType.SURFACE_BOAT})
CHANGE_MODE = 1.0  # MAV_DO_REPOSITION_FLAGS
DEFAULT_SPEED = -1.0
HOLD_OF_PX4 = 3.0  # its sub mode; its main mode has the number of an ArduPilot's HOLD


class Speeds(NamedTuple):
    """What is asked for: m/s ``forward``, rad/s clockwise.

    ``course`` is the direction in which to drive, rad from north, for a vehicle that is steered by
    it; that one drives forwards only, and the yaw rate does not count. With a course and no speed
    it stands, and turns there if it can.
    """

    forward: float
    yaw_rate: float = 0.0
    course: float | None = None

    @property
    def is_finite(self) -> bool:
        """Whether there is a number in each."""
        return isfinite(self.forward + self.yaw_rate + (self.course or 0.0))


STANDING = Speeds(0.0)
#: m/s along a course, on which a vehicle that is steered by course stands, or turns on the spot.
#: Zero has no course, and is taken for north. Below 1.2e-7 (FLT_EPSILON) PX4 1.17 switches its
#: speed loop off and forgets what that has wound up, so that no error of its estimate moves it.
STANDING_SPEED = 1e-8
#: m/s, on which one that rolls brakes by its speed loop: PX4's along its heading; an ArduPilot's,
#: which on zero lets go at 0.1 m/s and rolls on for 0.2 m as a car, or which drives on by a
#: throttle stick: that counts only in the direction that is asked for
BRAKING_SPEED = 1e-3
LEAST = 2 * BRAKING_SPEED  # m/s or rad/s; what is slower does not set a vehicle in motion


class Posture(NamedTuple):
    """What decides which set-point asks a vehicle to stand.

    ``heading`` is in rad from north, None while nothing fresh is known of it; ``rolls`` whether it
    still gets on along that; ``stick`` is 1 while its own throttle stick is held forward, -1 while
    it is held back, 0 at rest or where nothing is known of it.
    """

    heading: float | None = None
    rolls: bool = False
    stick: int = 0


def to_stand(persona: Persona, posture: Posture, *, armed: bool) -> Speeds:
    """Return what asks such a vehicle to stand as it is; plain zeros where it is not armed."""
    if not armed:
        return STANDING
    if persona.stands_by_course and posture.heading is not None:
        return Speeds(BRAKING_SPEED if posture.rolls else 0.0, course=posture.heading)
    if persona.heeds_throttle_stick and posture.stick:
        return Speeds(-copysign(BRAKING_SPEED, posture.stick))
    if persona.rolls_out and posture.rolls:
        return Speeds(BRAKING_SPEED)
    return STANDING


class Orders:
    """The messages for one vehicle."""

    def __init__(self, target: Address, persona: Persona) -> None:
        self._target = target
        self._persona = persona

    def __repr__(self) -> str:
        return f"Orders({self._target}, {self._persona.name})"

    def velocity(self, wanted: Speeds) -> SetPositionTargetLocalNed:
        """Return a setpoint; zeros for what such a vehicle cannot do."""
        vx, vy, yaw_rate = wanted.forward, 0.0, wanted.yaw_rate
        if not self._persona.honours_yaw_rate:
            speed = 0.0 if wanted.course is None else max(wanted.forward, STANDING_SPEED)
            course = wanted.course or 0.0
            vx, vy, yaw_rate = speed * cos(course), speed * sin(course), 0.0
        return SetPositionTargetLocalNed(
            time_boot_ms=0,
            target_system=self._target.system_id,
            target_component=self._target.component_id,
            coordinate_frame=self._persona.setpoint_frame,
            type_mask=self._persona.setpoint_mask,
            x=0.0,
            y=0.0,
            z=0.0,
            vx=vx,
            vy=vy,
            vz=0.0,
            afx=0.0,
            afy=0.0,
            afz=0.0,
            yaw=0.0,
            yaw_rate=yaw_rate,
        )

    def mode(self, mode: int) -> CommandLong:
        """Return the command that asks for a custom_mode."""
        return self._command(MavCmd.DO_SET_MODE, *self._persona.mode_params(mode))

    def hold(self) -> CommandLong:
        """Return the command that asks for HOLD, and means it in any autopilot's language.

        An ArduPilot reads mode 4, and no third parameter (4.6.3). A PX4 that has just taken its
        place reads main mode 4, sub mode 3: without the 3 it would start its mission.
        """
        enabled, mode, _ = self._persona.mode_params(self._persona.hold_mode)
        return self._command(MavCmd.DO_SET_MODE, enabled, mode, HOLD_OF_PX4)

    def arming(self, *, arm: bool) -> CommandLong:
        return self._command(MavCmd.COMPONENT_ARM_DISARM, float(arm))

    def staying_there(self, kind: int) -> CommandLong:
        """Return what asks a vehicle of any MAV_TYPE to stay where it is; it is never disarmed.

        An ArduPilot that flies or dives has other mode numbers, but this command.
        """
        if self._persona.has_main_modes or kind in DRIVEN:
            return self.hold()
        return self._command(MavCmd.NAV_LOITER_UNLIM, 0.0)

    def staying(self, *, changes_mode: bool) -> CommandInt:
        """Return the "go to" without a place: a vehicle that drives to one in HOLD stays here.

        With ``changes_mode`` it asks for HOLD, too. Heading and altitude are NaN, "not given": with
        a number in either, a PX4 drives on to the place that it has (1.17, navigator_main.cpp).
        """
        return CommandInt(
            *self._target,
            frame=MavFrame.GLOBAL,
            command=MavCmd.DO_REPOSITION,
            current=0,
            autocontinue=0,
            param1=DEFAULT_SPEED,
            param2=CHANGE_MODE if changes_mode else 0.0,
            param3=0.0,
            param4=nan,
            x=NOT_GIVEN,
            y=NOT_GIVEN,
            z=nan,
        )

    def _command(
        self, command: MavCmd, param1: float, param2: float = 0.0, param3: float = 0.0
    ) -> CommandLong:
        return CommandLong(*self._target, command, 0, param1, param2, param3, 0, 0, 0, 0)


def moves(message: Message) -> bool:
    """Whether it sets a vehicle in motion, or makes it ready for that: nothing to come late."""
    if isinstance(message, SetPositionTargetLocalNed):
        is_slow = abs(message.vx) < LEAST and abs(message.vy) < LEAST and abs(message.vz) < LEAST
        return not (is_slow and abs(message.yaw_rate) < LEAST)
    if isinstance(message, CommandLong) and message.command == MavCmd.COMPONENT_ARM_DISARM:
        return message.param1 != 0.0
    return False
