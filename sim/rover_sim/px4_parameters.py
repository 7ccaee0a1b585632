"""The parameters of a PX4 rover that clients or this simulator need."""

import math
from collections.abc import Iterable
from struct import pack, unpack
from zlib import crc32

from rover_sim.frames import Frame
from rover_sim.parameters import INT32, REAL32, UINT32, Parameter

WIRE_FORMATS = {INT32: "<i", UINT32: "<I"}


class Bytewise:
    """PX4's protocol: the float carries an integer's four bytes; implements ``ParameterProtocol``.

    A PARAM_SET whose type is not the parameter's is ignored without an answer.
    """

    tells_index = True
    answers_untaken = False

    def to_wire(self, value: float, type_: int) -> float:
        """Return the float with the value's bytes."""
        if type_ == REAL32:
            return value
        (as_float,) = unpack("<f", pack(WIRE_FORMATS[type_], int(value)))
        return float(as_float)

    def from_wire(self, value: float, type_: int, own_type: int) -> float | None:
        """Return the value with these bytes; None if the type is wrong or a float is not finite."""
        if type_ != own_type:
            return None
        if own_type == REAL32:
            return value if math.isfinite(value) else None
        (integer,) = unpack(WIRE_FORMATS[own_type], pack("<f", value))
        return float(integer)

    def digest(self, parameters: Iterable[tuple[Parameter, float]]) -> int | None:
        """Return a CRC over names and values."""
        digest = 0
        for parameter, value in parameters:
            as_sent = "<f" if parameter.type == REAL32 else WIRE_FORMATS[parameter.type]
            number = value if parameter.type == REAL32 else int(value)
            digest = crc32(parameter.name.encode() + pack(as_sent, number), digest)
        return digest


# COM_OF_LOSS_T, COM_OBL_RC_ACT, NAV_RCL_ACT, COM_DISARM_LAND, NAV_ACC_RAD, MAV_SYS_ID and RO_*
# control this simulator; QGroundControl complains without the others, at connect or in its setup
# pages. MPC_XY_VEL_MAX, for which QGroundControl offers "Change speed", is a multicopter's and not
# here. Values are 1.17's defaults; each frame adds its own (below).
COMMON: tuple[Parameter, ...] = (
    Parameter("BAT1_N_CELLS", 3, INT32),
    Parameter("BAT1_V_CHARGED", 4.05),
    Parameter("BAT1_V_EMPTY", 3.6),
    Parameter("CAL_ACC0_ID", 1310988, INT32),
    Parameter("CAL_GYRO0_ID", 1310988, INT32),
    Parameter("CAL_MAG0_ID", 0, INT32),
    Parameter("CAL_MAG1_ID", 0, INT32),
    Parameter("CAL_MAG2_ID", 0, INT32),
    *(Parameter(f"COM_FLTMODE{number}", -1, INT32) for number in range(1, 7)),  # none assigned
    Parameter("COM_DISARM_LAND", 2.0),
    Parameter("COM_LOW_BAT_ACT", 0, INT32),
    Parameter("COM_OBL_RC_ACT", 0, INT32),
    Parameter("COM_OF_LOSS_T", 1.0),
    Parameter("COM_RC_IN_MODE", 1, INT32),  # joystick, no RC: as in PX4's simulation start script
    Parameter("COM_RC_LOSS_T", 0.5),
    Parameter("MAV_COMP_ID", 1, INT32),
    Parameter("MAV_SYS_ID", 1, INT32),
    Parameter("MAV_TYPE", 10, INT32),
    Parameter("MIS_TAKEOFF_ALT", 2.5),
    Parameter("NAV_ACC_RAD", 0.5),  # of every rover's airframe
    Parameter("NAV_DLL_ACT", 0, INT32),
    Parameter("NAV_RCL_ACT", 2, INT32),
    Parameter("RC_MAP_AUX1", 0, INT32),
    Parameter("RC_MAP_AUX2", 0, INT32),
    Parameter("RC_MAP_FLAPS", 0, INT32),
    Parameter("RC_MAP_PITCH", 0, INT32),
    Parameter("RC_MAP_ROLL", 0, INT32),
    Parameter("RC_MAP_THROTTLE", 0, INT32),
    Parameter("RC_MAP_YAW", 0, INT32),
    Parameter("RTL_DESCEND_ALT", 30.0),
    Parameter("RTL_LAND_DELAY", 0.0),
    Parameter("RTL_RETURN_ALT", 60.0),
    Parameter("SYS_AUTOCONFIG", 0, INT32),
    Parameter("SYS_HAS_MAG", 0, INT32),
)

#: airframe 50000, and the values of the recorded rover
DIFFERENTIAL: tuple[Parameter, ...] = (
    Parameter("CA_AIRFRAME", 6, INT32),  # rover (differential)
    Parameter("RD_TRANS_DRV_TRN", 0.785398),  # rad: above it, turns on the spot towards a place
    Parameter("RD_TRANS_TRN_DRV", 0.174533),  # rad: below it, the rover drives again
    Parameter("RD_WHEEL_TRACK", 0.6),
    Parameter("RO_ACCEL_LIM", 4.0),
    Parameter("RO_DECEL_LIM", 6.0),
    Parameter("RO_JERK_LIM", 10.0),
    Parameter("RO_MAX_THR_SPEED", 2.0),
    Parameter("RO_SPEED_I", 0.01),
    Parameter("RO_SPEED_LIM", 1.8),
    Parameter("RO_SPEED_P", 0.01),
    Parameter("RO_SPEED_RED", 1.0),
    Parameter("RO_SPEED_TH", 0.1),  # m/s reported; slower counts as standing
    Parameter("RO_YAW_ACCEL_LIM", 400.0),
    Parameter("RO_YAW_DECEL_LIM", 800.0),
    Parameter("RO_YAW_P", 5.0),
    Parameter("RO_YAW_RATE_LIM", 250.0),
    Parameter("SYS_AUTOSTART", 50000, INT32),
)
#: airframe 51000 with the gains of 10045, PX4's own simulated rover
ACKERMANN: tuple[Parameter, ...] = (
    Parameter("CA_AIRFRAME", 5, INT32),  # rover (Ackermann)
    Parameter("RA_ACC_RAD_GAIN", 2.0),
    Parameter("RA_ACC_RAD_MAX", 3.0),
    Parameter("RA_MAX_STR_ANG", 0.4182),  # rad: atan(WHEEL_BASE / TURN_RADIUS)
    Parameter("RA_STR_RATE_LIM", 360.0),
    Parameter("RA_WHEEL_BASE", 0.4),
    Parameter("RO_ACCEL_LIM", 3.0),
    Parameter("RO_DECEL_LIM", 3.0),
    Parameter("RO_JERK_LIM", 10.0),
    Parameter("RO_MAX_THR_SPEED", 3.2),
    Parameter("RO_SPEED_I", 0.001),
    Parameter("RO_SPEED_LIM", 3.0),
    Parameter("RO_SPEED_P", 0.001),
    Parameter("RO_SPEED_RED", 1.0),
    Parameter("RO_SPEED_TH", 0.1),  # m/s reported; slower counts as standing
    Parameter("RO_YAW_ACCEL_LIM", 400.0),
    Parameter("RO_YAW_DECEL_LIM", 800.0),
    Parameter("RO_YAW_P", 5.0),
    Parameter("RO_YAW_RATE_LIM", 180.0),
    Parameter("SYS_AUTOSTART", 51000, INT32),
)


def px4_parameters(frame: Frame) -> tuple[Parameter, ...]:
    """Return the parameters of a rover, in the order in which PX4 lists them."""
    own = ACKERMANN if frame is Frame.ACKERMANN else DIFFERENTIAL
    return tuple(sorted((*COMMON, *own), key=lambda parameter: parameter.name))
