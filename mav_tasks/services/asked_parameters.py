"""Parameters that a vehicle is asked for until it has answered, or was asked often enough.

MAVLink guide, "Parameter Protocol". A vehicle that has no such parameter stays silent.
"""

from math import isfinite
from struct import pack, unpack

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamRequestRead, ParamValue

REAL32 = 9  # MAV_PARAM_TYPE
ASKS = 5  # times that a parameter is asked for, about once a second


class AskedParameters:
    """The values of some parameters of one vehicle."""

    def __init__(
        self, target: Address, names: tuple[str, ...], *, is_bytewise: bool, asks: int = ASKS
    ) -> None:
        """``is_bytewise``: an integer's bytes stand in the float of a PARAM_VALUE."""
        self._target = target
        self._names = names
        self._is_bytewise = is_bytewise
        self._asks_left = asks
        self._asks = asks
        self._values: dict[str, float] = {}
        self._unheard = set(names)  # since the vehicle has started

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._values})"

    def requests(self) -> list[ParamRequestRead]:
        """Return what is to be asked now; called about once a second."""
        names = [name for name in self._names if name in self._unheard and self._matters(name)]
        if not names or not self._asks_left:
            return []
        self._asks_left -= 1
        return [ParamRequestRead(*self._target, name.encode(), -1) for name in names]

    def receive(self, message: ParamValue) -> None:
        """Note the value of a parameter, also if somebody else asked for it or changed it."""
        name, value = message.param_id, float(message.param_value)
        if name not in self._names:
            return
        if self._is_bytewise and message.param_type != REAL32:
            (value,) = unpack("<i", pack("<f", value))
        if isfinite(value):
            self._values[name] = float(value)
            self._unheard.discard(name)

    def forget(self) -> None:
        """The vehicle has restarted: asked again, and until it answers they are as they were."""
        self._asks_left = self._asks
        self._unheard = set(self._names)

    def _matters(self, name: str) -> bool:  # noqa: ARG002
        """Return whether a parameter is to be asked for, by what is known so far."""
        return True
