"""The parameters of ArduPilot Rover that clients or this simulator need."""

import math
from collections.abc import Iterable

from rover_sim.frames import ARDUPILOT_FRAMES, Frame
from rover_sim.parameters import INT8, INT16, INT32, Parameter


class Cast:
    """ArduPilot's protocol: every value is cast to a float; implements ``ParameterProtocol``."""

    tells_index = False
    answers_untaken = True

    def to_wire(self, value: float, type_: int) -> float:
        """Return the value unchanged."""
        del type_
        return value

    def from_wire(self, value: float, type_: int, own_type: int) -> float | None:
        """Return the value, whatever type the client names; None if it is not finite."""
        del type_, own_type
        return value if math.isfinite(value) else None

    def digest(self, parameters: Iterable[tuple[Parameter, float]]) -> int | None:
        """Return None: ArduPilot has no hash of its parameters."""
        del parameters
        return None


def _rc_channels() -> Iterable[Parameter]:
    for channel in (1, 2, 3, 4):
        yield Parameter(f"RC{channel}_MIN", 1000, INT16)
        yield Parameter(f"RC{channel}_MAX", 2000, INT16)
        yield Parameter(f"RC{channel}_TRIM", 1500, INT16)


def _setup_pages() -> Iterable[Parameter]:
    for number in range(1, 7):
        yield Parameter(f"MODE{number}", 0, INT8)
    # No rover has these; QGroundControl 4 asks for them by the copter's names anyway.
    for number in range(1, 7):
        yield Parameter(f"FLTMODE{number}", 0, INT8)
    for compass in ("", "2", "3"):
        yield Parameter(f"COMPASS_USE{compass}", 1, INT8)
        for axis in "XYZ":
            yield Parameter(f"COMPASS_OFS{compass}_{axis}", 0.0)


# QGroundControl complains at connect without the first 24, and on its setup pages without
# _setup_pages(). The others control this simulator. Rover 4.6 has no WPNAV_SPEED (a copter's) and
# no WP_SPD (4.7's), so QGroundControl offers no "Change speed" for it, as for the real one.
COMMON: tuple[Parameter, ...] = (
    Parameter("SYSID_THISMAV", 1, INT16),
    Parameter("RCMAP_ROLL", 1, INT8),
    Parameter("RCMAP_PITCH", 2, INT8),
    Parameter("RCMAP_THROTTLE", 3, INT8),
    Parameter("RCMAP_YAW", 4, INT8),
    *_rc_channels(),
    Parameter("COMPASS_DEV_ID", 0, INT32),
    Parameter("COMPASS_DEV_ID2", 0, INT32),
    Parameter("COMPASS_DEV_ID3", 0, INT32),
    Parameter("INS_ACCOFFS_X", 0.01),
    Parameter("INS_ACCOFFS_Y", 0.01),
    Parameter("INS_ACCOFFS_Z", 0.01),
    Parameter("FRAME_CLASS", 1, INT8),
    Parameter("SYSID_MYGCS", 255, INT16),
    Parameter("SYSID_ENFORCE", 0, INT8),
    Parameter("FS_GCS_ENABLE", 0, INT8),
    Parameter("FS_GCS_TIMEOUT", 2.0),
    Parameter("FS_TIMEOUT", 1.5),
    Parameter("FS_ACTION", 2, INT8),
    Parameter("WP_SPEED", 5.0),
    Parameter("CRUISE_SPEED", 5.0),
    Parameter("ARMING_CHECK", 1, INT32),
    Parameter("BATT_MONITOR", 4, INT8),  # voltage and current
    Parameter("COMPASS_DEC", 0.0),
    Parameter("MODE_CH", 8, INT8),
    *_setup_pages(),
)


def ardupilot_parameters(frame: Frame) -> tuple[Parameter, ...]:
    """Return the parameters of a rover; the output functions identify its frame."""
    outputs = ARDUPILOT_FRAMES[frame].items()
    first, *others = COMMON
    return (first, *(Parameter(name, value, INT16) for name, value in outputs), *others)
