"""The autopilot's parameters and the parameter protocol, vehicle side.

MAVLink guide, "Parameter Protocol"; the persona's ``ParameterProtocol`` encodes the values.
Requests for an unknown name get no answer, as from the real autopilots.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.address import Address
from rover_sim.dispatch import Handler
from rover_sim.outbox import Outbox

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


class ParameterProtocol(Protocol):
    """How one make encodes PARAM_VALUE and decodes PARAM_SET."""

    tells_index: bool  # also in answers to PARAM_SET and to reads by name

    def to_wire(self, value: float, type_: int) -> float:
        """Return the value as PARAM_VALUE carries it."""
        ...

    def from_wire(self, value: float, type_: int, own_type: int) -> float | None:
        """Return the value of a PARAM_SET, sent as ``type_`` for a parameter of ``own_type``.

        None: the make rejects it.
        """
        ...

    answers_untaken: bool  # a rejected PARAM_SET is answered with the old value

    def digest(self, parameters: Iterable[tuple[Parameter, float]]) -> int | None:
        """Return _HASH_CHECK's value, or None if this make has none."""
        ...


class Parameters:
    """The values, and the handlers of the parameter messages. They survive a reboot."""

    def __init__(
        self,
        parameters: Iterable[Parameter],
        protocol: ParameterProtocol,
        outbox: Outbox,
    ) -> None:
        self._listed = tuple(parameters)
        self._protocol = protocol
        self._indices = {each.name: index for index, each in enumerate(self._listed)}
        self._values = {each.name: each.value for each in self._listed}
        self._outbox = outbox
        self.handlers: Mapping[int, Handler] = {
            messages.ParamRequestList.id: self._handle_request_list,
            messages.ParamRequestRead.id: self._handle_request_read,
            messages.ParamSet.id: self._handle_set,
        }

    def __repr__(self) -> str:
        return f"Parameters({len(self._listed)})"

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

    def _handle_request_list(
        self, _message: messages.ParamRequestList, _sender: Address, _now: float
    ) -> None:
        self._send_digest()  # PX4 sends its hash first (mavlink_parameters.cpp)
        for index in range(len(self._listed)):
            self._send(index, index)

    def _handle_request_read(
        self, message: messages.ParamRequestRead, _sender: Address, _now: float
    ) -> None:
        index, name = message.param_index, _name_of(message.param_id)
        if 0 <= index < len(self._listed):
            self._send(index, index)
        elif index == BY_NAME and name == HASH_CHECK:
            self._send_digest()
        elif index == BY_NAME and name in self._indices:
            self._answer(self._indices[name])

    def _handle_set(self, message: messages.ParamSet, _sender: Address, _now: float) -> None:
        """Answer with the stored value, even if it is unchanged."""
        index = self._indices.get(_name_of(message.param_id))
        if index is None:
            return
        own = self._listed[index]
        value = self._protocol.from_wire(message.param_value, message.param_type, own.type)
        if value is not None:
            self[own.name] = value
        elif not self._protocol.answers_untaken:
            return
        self._answer(index)

    def _answer(self, index: int) -> None:
        self._send(index, index if self._protocol.tells_index else UNNUMBERED)

    def _send(self, index: int, told: int) -> None:
        own = self._listed[index]
        value = self._protocol.to_wire(self._values[own.name], own.type)
        self._outbox.send(
            messages.ParamValue(own.name.encode(), value, own.type, len(self._listed), told)
        )

    def _send_digest(self) -> None:
        digest = self._protocol.digest((each, self._values[each.name]) for each in self._listed)
        if digest is None:
            return
        value = self._protocol.to_wire(digest, UINT32)
        name, count = HASH_CHECK.encode(), len(self._listed)
        self._outbox.send(messages.ParamValue(name, value, UINT32, count, UNNUMBERED))


def _name_of(param_id: str | bytes) -> str:
    text = param_id.decode("ascii", "replace") if isinstance(param_id, bytes) else param_id
    return text.split("\0", 1)[0]
