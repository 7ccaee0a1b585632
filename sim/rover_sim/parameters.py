"""The autopilot's parameters and the parameter protocol, vehicle side.

MAVLink guide, "Parameter Protocol". Requests for an unknown name get no answer, as from the real
autopilots.
"""

import math
from dataclasses import dataclass
from struct import pack, unpack
from zlib import crc32

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from rover_sim.onboard import Onboard

INT8, INT16, UINT32, INT32, REAL32 = 2, 4, 5, 6, 9  # MAV_PARAM_TYPE
BY_NAME = -1  # param_index in a request
UNNUMBERED = 65535  # param_index of a parameter outside the list, or if the make does not send it
HASH_CHECK = "_HASH_CHECK"  # hash of all parameters; a client with a cache requests it (PX4)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter and its value at first start."""

    name: str
    value: float
    type: int = REAL32


WIRE_FORMATS = {INT32: "<i", UINT32: "<I", REAL32: "<f"}  # of bytewise makes


class Parameters:
    """The values, and the handlers of the parameter messages. They survive a reboot."""

    def __init__(self, on: Onboard) -> None:
        """A ``bytewise`` persona's integers travel as their bytes, as on PX4, not as numbers.

        Such a make ignores a PARAM_SET of another type than the parameter's, names the index in
        each answer, and sends a hash over the list.
        """
        self._listed, self._bytewise = on.persona.parameters, on.persona.bytewise
        self._indices = {each.name: index for index, each in enumerate(self._listed)}
        self._values = {each.name: each.value for each in self._listed}
        self._outbox = on.outbox

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __setitem__(self, name: str, value: float) -> None:
        if self._listed[self._indices[name]].type != REAL32:
            value = round(value)
        self._values[name] = value

    def change(self, name: str, value: float) -> None:
        """Set a value as the autopilot itself does, and send it to everybody."""
        self[name] = value
        self._send(self._indices[name], UNNUMBERED)

    def on_param_request_list(self, _message: messages.ParamRequestList, _sender: Address) -> None:
        """Send the list."""
        self._send_hash()  # PX4 sends its hash first (mavlink_parameters.cpp)
        for index in range(len(self._listed)):
            self._send(index, index)

    def on_param_request_read(self, message: messages.ParamRequestRead, _sender: Address) -> None:
        """Send a parameter, by its index or its name."""
        index, name = message.param_index, _name_of(message.param_id)
        if 0 <= index < len(self._listed):
            self._send(index, index)
        elif index == BY_NAME and name == HASH_CHECK:
            self._send_hash()
        elif index == BY_NAME and name in self._indices:
            self._answer(self._indices[name])

    def on_param_set(self, message: messages.ParamSet, _sender: Address) -> None:
        """Answer with the stored value, even if it is unchanged."""
        index = self._indices.get(_name_of(message.param_id))
        if index is None:
            return
        own, value = self._listed[index], message.param_value
        if self._bytewise and own.type != message.param_type:
            return
        if self._bytewise and own.type != REAL32:
            (self[own.name],) = unpack(WIRE_FORMATS[own.type], pack("<f", value))
        elif math.isfinite(value):
            self[own.name] = value
        elif self._bytewise:
            return
        self._answer(index)

    def _answer(self, index: int) -> None:
        self._send(index, index if self._bytewise else UNNUMBERED)

    def _send(self, index: int, told: int) -> None:
        own = self._listed[index]
        self._tell(own.name, self._values[own.name], own.type, told)

    def _tell(self, name: str, value: float, type_: int, told: int) -> None:
        if self._bytewise:
            (value,) = unpack("<f", _bytes_of(value, type_))
        count = len(self._listed)
        self._outbox.send(messages.ParamValue(name.encode(), value, type_, count, told))

    def _send_hash(self) -> None:
        if not self._bytewise:
            return
        digest = 0
        for each in self._listed:
            value = _bytes_of(self._values[each.name], each.type)
            digest = crc32(each.name.encode() + value, digest)
        self._tell(HASH_CHECK, digest, UINT32, UNNUMBERED)


def _bytes_of(value: float, type_: int) -> bytes:
    return pack(WIRE_FORMATS[type_], value if type_ == REAL32 else int(value))


def _name_of(param_id: str | bytes) -> str:
    text = param_id.decode("ascii", "replace") if isinstance(param_id, bytes) else param_id
    return text.split("\0", 1)[0]
