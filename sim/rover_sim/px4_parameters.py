"""The parameters of a PX4 rover, as far as clients or this simulator need them."""

import math
from collections.abc import Iterable
from struct import pack, unpack
from zlib import crc32

from rover_sim.parameters import INT32, REAL32, UINT32, Parameter

WIRE_FORMATS = {INT32: "<i", UINT32: "<I"}


class Bytewise:
    """PX4's protocol: an integer's four bytes stand in the float; implements ``ParameterProtocol``.

    A PARAM_SET of another type than the parameter's is not taken and not answered.
    """

    tells_index = True
    answers_untaken = False

    def to_wire(self, value: float, type_: int) -> float:
        """Give the float that has the value's bytes."""
        if type_ == REAL32:
            return value
        (as_float,) = unpack("<f", pack(WIRE_FORMATS[type_], int(value)))
        return float(as_float)

    def from_wire(self, value: float, type_: int, own_type: int) -> float | None:
        """Give the value whose bytes these are."""
        if type_ != own_type:
            return None
        if own_type == REAL32:
            return value if math.isfinite(value) else None
        (integer,) = unpack(WIRE_FORMATS[own_type], pack("<f", value))
        return float(integer)

    def digest(self, parameters: Iterable[tuple[Parameter, float]]) -> int | None:
        """Give a CRC over names and values."""
        digest = 0
        for parameter, value in parameters:
            as_sent = "<f" if parameter.type == REAL32 else WIRE_FORMATS[parameter.type]
            number = value if parameter.type == REAL32 else int(value)
            digest = crc32(parameter.name.encode() + pack(as_sent, number), digest)
        return digest


# COM_OF_LOSS_T, COM_OBL_RC_ACT, MAV_SYS_ID and RD_MAX_SPEED steer this simulator; the others keep
# QGroundControl from complaining, at connect and in its setup pages. In order, as PX4 lists them.
# MPC_XY_VEL_MAX, for which QGroundControl offers "Change speed", is a multicopter's: not here.
PX4_PARAMETERS: tuple[Parameter, ...] = (
    Parameter("BAT1_N_CELLS", 3, INT32),
    Parameter("BAT1_V_CHARGED", 4.05),
    Parameter("BAT1_V_EMPTY", 3.6),
    Parameter("CAL_ACC0_ID", 1310988, INT32),
    Parameter("CAL_GYRO0_ID", 1310988, INT32),
    Parameter("CAL_MAG0_ID", 0, INT32),
    Parameter("CAL_MAG1_ID", 0, INT32),
    Parameter("CAL_MAG2_ID", 0, INT32),
    *(Parameter(f"COM_FLTMODE{number}", -1, INT32) for number in range(1, 7)),  # none assigned
    Parameter("COM_LOW_BAT_ACT", 0, INT32),
    Parameter("COM_OBL_RC_ACT", 0, INT32),
    Parameter("COM_OF_LOSS_T", 1.0),
    Parameter("COM_RC_IN_MODE", 1, INT32),  # no RC
    Parameter("COM_RC_LOSS_T", 0.5),
    Parameter("MAV_COMP_ID", 1, INT32),
    Parameter("MAV_SYS_ID", 1, INT32),
    Parameter("MAV_TYPE", 10, INT32),
    Parameter("MIS_TAKEOFF_ALT", 2.5),
    Parameter("NAV_ACC_RAD", 0.3),
    Parameter("NAV_DLL_ACT", 0, INT32),
    Parameter("NAV_RCL_ACT", 0, INT32),
    Parameter("RC_MAP_AUX1", 0, INT32),
    Parameter("RC_MAP_AUX2", 0, INT32),
    Parameter("RC_MAP_FLAPS", 0, INT32),
    Parameter("RC_MAP_PITCH", 0, INT32),
    Parameter("RC_MAP_ROLL", 0, INT32),
    Parameter("RC_MAP_THROTTLE", 0, INT32),
    Parameter("RC_MAP_YAW", 0, INT32),
    Parameter("RD_MAX_SPEED", 5.0),
    Parameter("RTL_DESCEND_ALT", 30.0),
    Parameter("RTL_LAND_DELAY", 0.0),
    Parameter("RTL_RETURN_ALT", 60.0),
    Parameter("SYS_AUTOCONFIG", 0, INT32),
    Parameter("SYS_AUTOSTART", 50000, INT32),
    Parameter("SYS_HAS_MAG", 0, INT32),
)
