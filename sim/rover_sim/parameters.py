"""The autopilot's parameters and the parameter protocol, vehicle side.

MAVLink guide, "Parameter Protocol", in ArduPilot's encoding: every value is cast to a float. An
unknown name gets no answer at all, as from the real one.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from rover_sim.dispatch import Handler
from rover_sim.outbox import Outbox

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9  # MAV_PARAM_TYPE
BY_NAME = -1  # param_index in a request
UNNUMBERED = 65535  # param_index in an answer to a read by name, or to a set


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter and its value at first start."""

    name: str
    value: float
    type: int = REAL32


def _rc_channels() -> Iterable[Parameter]:
    for channel in (1, 2, 3, 4):
        yield Parameter(f"RC{channel}_MIN", 1000, INT16)
        yield Parameter(f"RC{channel}_MAX", 2000, INT16)
        yield Parameter(f"RC{channel}_TRIM", 1500, INT16)


# The first 24 keep QGroundControl from complaining at connect; the others steer this simulator.
ARDUPILOT_PARAMETERS: tuple[Parameter, ...] = (
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
)


class Parameters:
    """The values, and what answers the parameter messages. They survive a reboot."""

    def __init__(self, parameters: Iterable[Parameter], outbox: Outbox) -> None:
        listed = tuple(parameters)
        self._types = {parameter.name: parameter.type for parameter in listed}
        self._values = {parameter.name: parameter.value for parameter in listed}
        self._names = tuple(self._values)
        self._outbox = outbox
        self.handlers: Mapping[int, Handler] = {
            messages.ParamRequestList.id: self._handle_request_list,
            messages.ParamRequestRead.id: self._handle_request_read,
            messages.ParamSet.id: self._handle_set,
        }

    def __repr__(self) -> str:
        return f"Parameters({len(self._names)})"

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __setitem__(self, name: str, value: float) -> None:
        if self._types[name] != REAL32:
            value = round(value)
        self._values[name] = value

    def _handle_request_list(
        self, _message: messages.ParamRequestList, _sender: Address, _now: float
    ) -> None:
        for index, name in enumerate(self._names):
            self._send(name, index)

    def _handle_request_read(
        self, message: messages.ParamRequestRead, _sender: Address, _now: float
    ) -> None:
        index = message.param_index
        if 0 <= index < len(self._names):
            self._send(self._names[index], index)
        elif index == BY_NAME and (name := _name_of(message.param_id)) in self._values:
            self._send(name, UNNUMBERED)

    def _handle_set(self, message: messages.ParamSet, _sender: Address, _now: float) -> None:
        """The answer carries what is kept, also if that is the old value."""
        name = _name_of(message.param_id)
        if name not in self._values:
            return
        if math.isfinite(message.param_value):
            self[name] = message.param_value
        self._send(name, UNNUMBERED)

    def _send(self, name: str, index: int) -> None:
        self._outbox.send(
            messages.ParamValue(
                name.encode(), self._values[name], self._types[name], len(self._names), index
            )
        )


def _name_of(param_id: str | bytes) -> str:
    text = param_id.decode("ascii", "replace") if isinstance(param_id, bytes) else param_id
    return text.split("\0", 1)[0]
