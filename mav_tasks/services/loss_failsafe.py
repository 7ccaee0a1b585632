"""Whether a vehicle stops by itself when setpoints stop: PX4's offboard-loss failsafe, as its
parameters have it. MAVLink guide, "Parameter Protocol"; PX4 parameters of 1.15.
"""

from math import isnan
from struct import pack, unpack

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamRequestRead, ParamValue

AFTER, ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"  # s; what is done then
DISABLED = -1  # an action, of versions before 1.14
LONGEST = 5.0  # s that a vehicle may drive on without setpoints; ArduPilot takes 3
ASKS = 10  # times that a parameter is asked for
NEVER = ASKS + 1
REAL32 = 9  # MAV_PARAM_TYPE; an integer's bytes stand in the float


class LossFailsafe:
    """What is known of one vehicle's failsafe."""

    def __init__(self, target: Address, *, is_by_parameters: bool) -> None:
        self._target = target
        self._values: dict[str, float] = {}
        self._asked = 0 if is_by_parameters else NEVER
        self._has_changed = False  # what ``why_off`` gives, or they were asked for in vain

    def __repr__(self) -> str:
        return f"LossFailsafe({self._values})"

    @property
    def is_unknown(self) -> bool:
        """Whether it was asked for, and did not say."""
        return self._asked == ASKS and len(self._values) < len((AFTER, ACTION))

    @property
    def why_off(self) -> str:
        """Give in words why the vehicle would drive on without us; "": it stops, or is unknown."""
        after, action = self._values.get(AFTER, 0.0), self._values.get(ACTION, 0.0)
        if action <= DISABLED:
            return f"{ACTION} is {action:g}"
        if not after <= LONGEST:
            return f"{AFTER} is {after:g} s, more than {LONGEST:g}"
        return ""

    def requests(self) -> list[ParamRequestRead]:
        """Give what is to be asked now; called about once a second."""
        missing = [name for name in (AFTER, ACTION) if name not in self._values]
        if not missing or self._asked >= ASKS:
            return []
        self._asked += 1
        self._has_changed = self._has_changed or self.is_unknown
        return [ParamRequestRead(*self._target, name.encode(), -1) for name in missing]

    def receive(self, message: ParamValue) -> None:
        """Take in a parameter of the vehicle; whoever asked for it, or changed it."""
        if self._asked == NEVER:
            return
        name = _text(message.param_id)
        if name not in (AFTER, ACTION):
            return
        value = message.param_value
        if message.param_type != REAL32:
            (value,) = unpack("<i", pack("<f", value))
        if isnan(value):
            return
        before = self.why_off
        self._values[name] = float(value)
        self._has_changed = self._has_changed or self.why_off != before

    def take_news(self) -> str:
        """Give in words what is known anew, "" if nothing is."""
        if not self._has_changed:
            return ""
        self._has_changed = False
        if self.is_unknown:
            return "does not say whether it stops when setpoints stop"
        if self.why_off:
            return f"would drive on without setpoints: {self.why_off}"
        return "stops when setpoints stop"

    def forget(self) -> None:
        """The vehicle has restarted."""
        if self._asked != NEVER:
            self._asked = 0


def _text(param_id: str | bytes) -> str:
    text = param_id.decode("ascii", "replace") if isinstance(param_id, bytes) else param_id
    return text.rstrip("\0")
