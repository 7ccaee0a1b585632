"""The speed at which a vehicle itself drives where no speed is named, as its parameters have it.

MAVLink guide, "Parameter Protocol"; ArduPilot Rover 4.6: WP_SPEED, or CRUISE_SPEED where that is 0;
PX4 1.16: RO_SPEED_LIM, -1 for none.
"""

from math import isfinite

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamRequestRead, ParamValue

ASKS = 5  # times, about once a second: a version that has no such parameter stays silent
REAL32 = 9  # MAV_PARAM_TYPE, of all of them


class CruiseSpeed:
    """What is known of one vehicle's speed, m/s."""

    def __init__(self, target: Address, names: tuple[str, ...]) -> None:
        self._target = target
        self._names = names
        self._values: dict[str, float] = {}
        self._unheard = set(names)  # since it was switched on
        self._asked = 0

    def __repr__(self) -> str:
        return f"CruiseSpeed({self._values})"

    @property
    def speed(self) -> float | None:
        """The least of the speeds that the vehicle names, None if it names none."""
        return min((value for value in self._values.values() if value > 0.0), default=None)

    def requests(self) -> list[ParamRequestRead]:
        """Return what is to be asked now; called about once a second."""
        missing = [name for name in self._names if name in self._unheard]
        if not missing or self._asked >= ASKS:
            return []
        self._asked += 1
        return [ParamRequestRead(*self._target, name.encode(), -1) for name in missing]

    def receive(self, message: ParamValue) -> None:
        """Take in a parameter of the vehicle, whoever has asked for it, or changed it."""
        name = message.param_id
        if name in self._names and message.param_type == REAL32 and isfinite(message.param_value):
            self._values[name] = message.param_value
            self._unheard.discard(name)

    def forget(self) -> None:
        """The vehicle has restarted: it may have other parameters."""
        self._asked = 0
        self._unheard = set(self._names)
