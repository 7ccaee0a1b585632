"""How an autopilot wants to be spoken to: modes, order, setpoints. Recognised from its HEARTBEAT.

What a family of autopilots does otherwise than another is a field here; nothing asks for its name.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isnan

from mav_tasks.config.settings import Turning
from mav_tasks.mavlink.enums import MavAutopilot, MavFrame, MavModeFlag, PositionTargetTypemask
from mav_tasks.mavlink.messages import Heartbeat

T = PositionTargetTypemask

NO_MODE = -1
SERVO = "SERVO"  # how the names of ArduPilot's outputs begin
MAIN_BITS, SUB_BITS = 16, 24  # where PX4's custom_mode has its main and its sub mode
VELOCITY_ONLY = int(T.X_IGNORE | T.Y_IGNORE | T.Z_IGNORE | T.AX_IGNORE | T.AY_IGNORE | T.AZ_IGNORE)
WITH_YAW_RATE = VELOCITY_ONLY | int(T.YAW_IGNORE)
BY_COURSE = VELOCITY_ONLY | int(T.YAW_IGNORE | T.YAW_RATE_IGNORE)


@dataclass(frozen=True, slots=True)
class Persona:
    """The conventions of one family of autopilots."""

    name: str
    autopilot: int  # MAV_AUTOPILOT of its heartbeat
    control_mode: int  # custom_mode in which setpoints are followed
    hold_mode: int  # custom_mode in which the vehicle stands
    manual_modes: frozenset[int]  # a person drives
    return_mode: int  # drives back to where it was armed
    mission_mode: int  # drives the uploaded mission
    booting_mode: int  # left without anybody's doing; NO_MODE: it shows none
    mode_names: Mapping[int, str]
    has_main_modes: bool  # a mode has two parts, which a command names apart
    has_home_item: bool  # the first item of a mission is home
    has_int_requests: bool  # it asks for the items of a plan with MISSION_REQUEST_INT
    #: it is armed in HOLD and enters our mode only while setpoints stream; else it is armed in our
    #: mode
    arms_in_hold: bool
    #: it may be driving to a place in HOLD, which asking for HOLD again does not end
    drives_in_hold: bool
    #: STOP may not depend on its HOLD: where that is not seen soon, it is disarmed
    stop_disarms: bool
    #: some clients ask for HOLD before each "go to", which nobody has wished for
    is_held_before_places: bool
    #: asked for the mission while it is disarmed, it begins it when it is armed
    starts_when_armed: bool
    #: what it does when setpoints stop is up to its parameters; when they return, so does our
    #: mode, by itself, and with what it was told last
    has_loss_failsafe: bool
    #: its set-points are speed and yaw rate, and it reverses; else they are speed and course, and
    #: it does not
    honours_yaw_rate: bool
    #: in our mode it drives as fast as set-point or throttle stick asks, whichever is more; a stick
    #: against the direction that is asked for does not count
    heeds_throttle_stick: bool
    #: MANUAL_CONTROL.z of a station whose throttle stick is centred
    centred_throttles: tuple[int, ...]
    #: an integer's bytes stand in a PARAM_VALUE's float; else the integer is cast
    has_bytewise_parameters: bool
    cruise_parameters: tuple[str, ...]  # m/s, of what names no speed
    turning_parameters: tuple[str, ...]  # what says how it turns
    probed_parameters: tuple[str, ...]  # others that the probe reads: failsafes and limits
    setpoint_mask: int  # POSITION_TARGET_TYPEMASK of our velocity setpoints
    setpoint_frame: int  # MAV_FRAME of our velocity setpoints
    turning: Turning = Turning.ON_SPOT  # whichever way its set-points are read
    turning_radius: float | None = None  # m, at the least, of one that is STEERED; None: not known
    #: it is known to turn on the spot to the course of a set-point that hardly moves it
    turns_by_course: bool = False

    def __repr__(self) -> str:
        return f"Persona({self.name})"

    @property
    def brakes_by_setpoints(self) -> bool:
        """Whether it stands sooner by set-points than by its HOLD.

        One that steers as a car rolls on in HOLD (ArduPilot), or drives a loop back to where it
        began (PX4): STOP asks for HOLD when it stands, or when set-points have no effect.
        """
        return self.turning is Turning.STEERED

    @property
    def rolls_out(self) -> bool:
        """Whether it lets go before it stands when zero is asked of it, and rolls on.

        An ArduPilot that steers as a car does so at 0.1 m/s (ATC_STOP_SPEED, 4.6.3). Asked for
        next to nothing it brakes on, and then swings back to 0.17 m/s: what makes it stand is the
        one until it nearly stands, and then the other.
        """
        return self.turning is Turning.STEERED and self.heeds_throttle_stick

    @property
    def stands_by_course(self) -> bool:
        """Whether it takes zero velocity for "to the north", and turns there.

        PX4 1.17 does: a differential rover turns on the spot, one that steers as a car bends while
        it brakes. It stands, as it is, on a velocity of next to nothing along its heading.
        """
        return not self.honours_yaw_rate

    def mode_name(self, mode: int) -> str:
        """Return a custom_mode in words, as ground stations show it."""
        return self.mode_names.get(mode, f"mode {mode}")

    def mode_params(self, mode: int) -> tuple[float, float, float]:
        """Return param1 to param3 of the DO_SET_MODE that asks for a custom_mode."""
        enabled = float(MavModeFlag.CUSTOM_MODE_ENABLED)
        if self.has_main_modes:
            return enabled, float(mode >> MAIN_BITS & 0xFF), float(mode >> SUB_BITS & 0xFF)
        return enabled, float(mode), 0.0

    def mode_in(self, param2: float, param3: float) -> int | None:
        """Return the custom_mode that a DO_SET_MODE names; None: these are no mode numbers."""
        if not self.has_main_modes:
            return _whole(param2, high=0xFFFFFFFF)
        main, sub = _whole(param2, high=0xFF), _whole(0.0 if isnan(param3) else param3, high=0xFF)
        return None if main is None or sub is None else main << MAIN_BITS | sub << SUB_BITS


def _whole(value: float, *, high: int) -> int | None:
    return int(value) if 0 <= value <= high and value == int(value) else None


#: ArduPilot Rover. With the yaw rate unmasked it turns on the spot, and vx < 0 reverses; a pure
#: velocity would turn the vehicle round instead (observed on 4.6.3). Mask 0x05C7.
ARDUPILOT = Persona(
    name="ardupilot",
    autopilot=MavAutopilot.ARDUPILOTMEGA,
    control_mode=15,  # GUIDED
    hold_mode=4,
    manual_modes=frozenset({0}),
    return_mode=11,  # RTL
    mission_mode=10,  # AUTO
    booting_mode=16,  # INITIALISING
    mode_names={
        0: "MANUAL",
        1: "ACRO",
        3: "STEERING",
        4: "HOLD",
        5: "LOITER",
        6: "FOLLOW",
        7: "SIMPLE",
        8: "DOCK",
        9: "CIRCLE",
        10: "AUTO",
        11: "RTL",
        12: "SMART_RTL",
        15: "GUIDED",
        16: "INITIALISING",
    },
    has_main_modes=False,
    has_home_item=True,
    has_int_requests=False,  # MISSION_REQUEST always (4.6.3)
    arms_in_hold=False,
    drives_in_hold=False,
    stop_disarms=False,
    is_held_before_places=False,
    starts_when_armed=False,
    has_loss_failsafe=False,  # it stops after 3 s (observed on 4.6.3)
    honours_yaw_rate=True,
    heeds_throttle_stick=True,  # 4.6.3
    centred_throttles=(0,),  # 500 is half throttle ahead
    has_bytewise_parameters=False,
    cruise_parameters=("WP_SPEED", "CRUISE_SPEED"),
    turning_parameters=(
        *(f"{SERVO}{number}_FUNCTION" for number in range(1, 9)),  # a rover's are among these
        "TURN_RADIUS",
    ),
    probed_parameters=(  # the newest names too (4.7); a rover has either the one or the other
        *("SYSID_MYGCS", "SYSID_ENFORCE", "MAV_GCS_SYSID", "MAV_OPTIONS"),
        *("FS_ACTION", "FS_TIMEOUT", "FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_THR_ENABLE"),
        *("FS_EKF_ACTION", "FS_CRASH_CHECK", "GUID_OPTIONS", "FENCE_ENABLE", "FENCE_ACTION"),
        *("ARMING_CHECK", "ARMING_REQUIRE", "WP_SPEED", "CRUISE_SPEED", "ATC_DECEL_MAX"),
    ),
    setpoint_mask=WITH_YAW_RATE,
    setpoint_frame=MavFrame.BODY_NED,
)


def _px4(main: int, sub: int = 0) -> int:
    return main << MAIN_BITS | sub << SUB_BITS


#: A PX4 rover, 1.15. Its velocity is a vector over ground, in the direction of which it turns by
#: itself; yaw and yaw rate are passed over. Mask 0x0DC7.
PX4 = Persona(
    name="px4",
    autopilot=MavAutopilot.PX4,
    control_mode=_px4(6),  # OFFBOARD
    hold_mode=_px4(4, 3),
    manual_modes=frozenset(map(_px4, (1, 2, 3, 5, 7, 8, 9))),
    return_mode=_px4(4, 5),
    mission_mode=_px4(4, 4),
    booting_mode=NO_MODE,
    mode_names={
        _px4(1): "Manual",
        _px4(2): "Altitude",
        _px4(3): "Position",
        _px4(4, 1): "Ready",
        _px4(4, 2): "Takeoff",
        _px4(4, 3): "Hold",
        _px4(4, 4): "Mission",
        _px4(4, 5): "Return",
        _px4(4, 6): "Land",
        _px4(4, 8): "Follow",
        _px4(5): "Acro",
        _px4(6): "Offboard",
        _px4(7): "Stabilized",
    },
    has_main_modes=True,
    has_home_item=False,
    has_int_requests=True,
    arms_in_hold=True,
    drives_in_hold=True,
    stop_disarms=False,
    is_held_before_places=True,
    starts_when_armed=True,
    has_loss_failsafe=True,
    honours_yaw_rate=False,
    heeds_throttle_stick=False,
    # it reads 0 to 1000 as full reverse to full ahead; stations whose stick has its zero at the
    # centre send 0 all the same
    centred_throttles=(0, 500),
    has_bytewise_parameters=True,
    cruise_parameters=("RO_SPEED_LIM",),
    turning_parameters=("CA_AIRFRAME", "SYS_AUTOSTART", "RA_WHEEL_BASE", "RA_MAX_STR_ANG"),
    probed_parameters=(
        *("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "COM_RC_IN_MODE", "COM_RC_LOSS_T", "COM_DL_LOSS_T"),
        *("NAV_RCL_ACT", "COM_RCL_EXCEPT", "NAV_DLL_ACT", "COM_DLL_EXCEPT", "COM_FAIL_ACT_T"),
        *("COM_DISARM_PRFLT", "RO_SPEED_LIM"),
    ),
    setpoint_mask=BY_COURSE,
    setpoint_frame=MavFrame.LOCAL_NED,
)

#: speaks as PX4 does; what else is in it nobody knows
GENERIC = replace(
    PX4,
    name="generic",
    autopilot=MavAutopilot.GENERIC,
    stop_disarms=True,
    is_held_before_places=False,
)

#: by name
PERSONAS: Mapping[str, Persona] = {each.name: each for each in (ARDUPILOT, PX4, GENERIC)}
_BY_AUTOPILOT = {each.autopilot: each for each in PERSONAS.values()}


def persona_of(heartbeat: Heartbeat, *, honours_yaw_rate: bool = False) -> Persona | None:
    """Return the persona that a vehicle's heartbeat shows, or None if it is none that we drive.

    ``honours_yaw_rate``: one that need not, turns at a yaw rate all the same.
    """
    persona = _BY_AUTOPILOT.get(heartbeat.autopilot)
    if persona is None or persona.honours_yaw_rate or not honours_yaw_rate:
        return persona
    return with_yaw_rate(persona, is_honoured=True)


def with_yaw_rate(persona: Persona, *, is_honoured: bool) -> Persona:
    """Return the persona as one that follows yaw rates and reverses, or is steered by course."""
    return replace(
        persona,
        honours_yaw_rate=is_honoured,
        setpoint_mask=WITH_YAW_RATE if is_honoured else BY_COURSE,
        setpoint_frame=MavFrame.BODY_NED if is_honoured else MavFrame.LOCAL_NED,
    )


def with_turning(persona: Persona, turning: Turning, *, radius: float | None = None) -> Persona:
    """Return the persona of a vehicle that turns so.

    ``radius`` is the least turning radius in m, of one that is STEERED; None: not known.
    """
    is_car = turning is Turning.STEERED
    return replace(
        persona,
        turning=turning,
        turning_radius=radius if is_car else None,
        turns_by_course=not (is_car or persona.honours_yaw_rate),
    )
