"""What differs between makes of vehicle: numbers and names, as data."""

from dataclasses import dataclass

CUSTOM_MODE = 1  # MAV_MODE_FLAG
ARDUPILOTMEGA, PX4 = 3, 12  # MAV_AUTOPILOT

RC_LIMITS = frozenset(f"RC{n}_{limit}" for n in range(1, 5) for limit in ("MIN", "MAX", "TRIM"))
AXES = ("X", "Y", "Z")
APM_AT_CONNECT = (
    frozenset({"RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_THROTTLE", "RCMAP_YAW", "FRAME_CLASS"})
    | RC_LIMITS
    | {"COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_DEV_ID3"}
    | {f"INS_ACCOFFS_{axis}" for axis in AXES}
)
APM_IN_SETUP = (
    frozenset({"MODE_CH", "COMPASS_DEC", "BATT_MONITOR", "ARMING_CHECK"})
    | {f"MODE{n}" for n in range(1, 7)}
    | {f"COMPASS_OFS{n}_{axis}" for n in ("", "2", "3") for axis in AXES}
)
PX4_AT_CONNECT = frozenset(
    {"SYS_AUTOSTART", "COM_RC_IN_MODE", "CAL_GYRO0_ID", "CAL_ACC0_ID", "SYS_HAS_MAG"}
)
PX4_IN_SETUP = (
    frozenset({"SYS_AUTOCONFIG", "MAV_SYS_ID", "CAL_MAG0_ID", "CAL_MAG1_ID", "CAL_MAG2_ID"})
    | {f"RC_MAP_{name}" for name in ("AUX1", "AUX2", "FLAPS", "THROTTLE", "YAW", "PITCH", "ROLL")}
    | {f"COM_FLTMODE{n}" for n in range(1, 7)}
    | {"BAT1_N_CELLS", "BAT1_V_EMPTY", "BAT1_V_CHARGED", "RTL_LAND_DELAY", "RTL_DESCEND_ALT"}
    | {"RTL_RETURN_ALT", "NAV_DLL_ACT", "COM_RC_LOSS_T", "NAV_RCL_ACT", "COM_LOW_BAT_ACT"}
)


@dataclass(frozen=True, slots=True)
class Conventions:
    """The conventions of one make."""

    name: str
    hold: int  # HEARTBEAT.custom_mode
    control: int  # the mode that follows setpoints: GUIDED, OFFBOARD
    nonsense: int  # a mode that does not exist
    accepts_nonsense: bool  # answers it with ACCEPTED, and changes nothing
    mode_in_two_parts: bool  # DO_SET_MODE: main mode in param2, sub mode in param3
    control_needs_stream: bool  # setpoints first, then the mode; else the mode first
    bytewise: bool  # the float carries an integer parameter's bytes; else its value
    has_digest: bool  # answers a read of _HASH_CHECK
    system_id_parameters: tuple[str, ...]  # any of them shows the system id
    at_connect: frozenset[str]  # parameters that QGroundControl requires at connect
    in_setup: frozenset[str]  # and in Vehicle Setup
    needs_mode_list: bool  # AVAILABLE_MODES
    honours_yaw_rate: bool
    stops_within: float  # s from the last setpoint to standstill
    home_is_item_0: bool  # in a mission
    landed_state_counts: bool  # QGroundControl needs it to see that the vehicle moves


ARDUPILOT_WAY = Conventions(
    name="ardupilot",
    hold=4,
    control=15,
    nonsense=99,
    accepts_nonsense=False,
    mode_in_two_parts=False,
    control_needs_stream=False,
    bytewise=False,
    has_digest=False,
    system_id_parameters=("SYSID_THISMAV", "MAV_SYSID"),
    at_connect=APM_AT_CONNECT,
    in_setup=APM_IN_SETUP,
    needs_mode_list=False,
    honours_yaw_rate=True,
    stops_within=3.0 + 4.0,  # its time-out, and braking
    home_is_item_0=True,
    landed_state_counts=False,
)
PX4_WAY = Conventions(
    name="px4",
    hold=4 << 16 | 3 << 24,
    control=6 << 16,
    nonsense=99 << 16,
    accepts_nonsense=True,  # 1.17
    mode_in_two_parts=True,
    control_needs_stream=True,
    bytewise=True,
    has_digest=True,
    system_id_parameters=("MAV_SYS_ID",),
    at_connect=PX4_AT_CONNECT,
    in_setup=PX4_IN_SETUP,
    needs_mode_list=True,
    honours_yaw_rate=False,
    stops_within=1.0 + 4.0,  # COM_OF_LOSS_T's default, and braking
    home_is_item_0=False,
    landed_state_counts=True,
)
#: an unknown make is driven like PX4; QGroundControl needs nothing more from it
GENERIC_WAY = Conventions(
    name="generic",
    hold=PX4_WAY.hold,
    control=PX4_WAY.control,
    nonsense=PX4_WAY.nonsense,
    accepts_nonsense=True,
    mode_in_two_parts=True,
    control_needs_stream=True,
    bytewise=True,
    has_digest=False,
    system_id_parameters=("MAV_SYS_ID",),
    at_connect=frozenset(),
    in_setup=frozenset(),
    needs_mode_list=False,
    honours_yaw_rate=False,
    stops_within=PX4_WAY.stops_within,
    home_is_item_0=False,
    landed_state_counts=True,
)
WAYS = {way.name: way for way in (ARDUPILOT_WAY, PX4_WAY, GENERIC_WAY)}


def way_of(autopilot: int) -> Conventions:
    """Return the conventions for a MAV_AUTOPILOT."""
    return {ARDUPILOTMEGA: ARDUPILOT_WAY, PX4: PX4_WAY}.get(autopilot, GENERIC_WAY)
