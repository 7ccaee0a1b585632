"""What a vehicle does when its setpoints stop, as its parameters have it: does it stand?

ArduPilot Rover stops 3 s after the last setpoint, whatever its parameters say. A PX4 rover does
what this table says (PX4 1.15 to 1.17: commander's failsafe.cpp, its parameters, a SITL of 1.17.0):

1. For COM_OF_LOSS_T seconds (1 by default) it goes on with the last setpoint.
2. Then it does as COM_OBL_RC_ACT says:

   | value | what it does |
   |---|---|
   | -1 | nothing (before 1.14) |
   | 0 (default), 1, 2, unknown | with sticks: Position, Altitude, Stabilized: sticks drive it; |
   | | without: as NAV_RCL_ACT says |
   | 3 | Return: it drives by itself to where it was armed |
   | 4 | Land: what a rover does then was never seen |
   | 5 | Hold: it stands |
   | 6, 7 | Terminate, Disarm: its motors are off |

3. NAV_RCL_ACT: 1 Hold, 2 (default) Return, 3 Land, 5 Terminate, 6 Disarm, others nothing.
4. COM_DL_LOSS_T seconds (10 by default) after the last heartbeat of a ground station, which the
   server is to it, NAV_DLL_ACT is done: 0 (default) nothing, else as NAV_RCL_ACT; not where bit 2
   of COM_DLL_EXCEPT excepts Offboard. Of all that is to be done it does what has most consequences:
   Return comes before Hold, so that it stands for 9 s and then drives home.

Whether there are sticks (COM_RC_IN_MODE; 4: never) makes no difference here: they may be lost in
the same moment as we are. Their loss alone is another matter (NAV_RCL_ACT, unless bit 2 of
COM_RCL_EXCEPT excepts Offboard): then the server is there, and sees the mode that it enters.
"""

from collections.abc import Mapping
from enum import Enum

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamRequestRead, ParamValue
from mav_tasks.services.asked_parameters import AskedParameters

AFTER, ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"  # s; what is done then
NO_STICKS = "NAV_RCL_ACT"
NO_STATION, EXCEPT = "NAV_DLL_ACT", "COM_DLL_EXCEPT"
OFFBOARD_BIT = 4  # of COM_DLL_EXCEPT
#: how the description of a vehicle begins that does not stop by itself
KEEPS_MOVING = "keeps moving when setpoints stop"
LONGEST = 5.0  # s that a vehicle may drive on without setpoints; ArduPilot takes 3
ASKS = 10  # times that a parameter is asked for
NAMES = (AFTER, ACTION, NO_STICKS, NO_STATION, EXCEPT)
#: what makes a PX4 rover stand: Hold after a second, and Hold where a ground station is missed
STANDING: Mapping[str, float] = {AFTER: 1.0, ACTION: 5, NO_STATION: 1}


class Deed(Enum):
    """What a failsafe does."""

    NOTHING = "nothing, it keeps driving"
    RETURN = "Return, it drives home"
    LAND = "Land, not known to stop a rover"
    HOLD = "Hold"
    OFF = "motors off"


STANDS = frozenset({Deed.HOLD, Deed.OFF})
OF_LOSS: Mapping[int, Deed] = {  # COM_OBL_RC_ACT; what is not listed asks for sticks
    -1: Deed.NOTHING,
    3: Deed.RETURN,
    4: Deed.LAND,
    5: Deed.HOLD,
    6: Deed.OFF,
    7: Deed.OFF,
}
OF_ABSENCE: Mapping[int, Deed] = {  # NAV_RCL_ACT and NAV_DLL_ACT
    1: Deed.HOLD,
    2: Deed.RETURN,
    3: Deed.LAND,
    5: Deed.OFF,
    6: Deed.OFF,
}


class LossFailsafe(AskedParameters):
    """What is known of one vehicle's failsafe."""

    def __init__(self, target: Address, *, is_by_parameters: bool) -> None:
        super().__init__(target, NAMES if is_by_parameters else (), is_bytewise=True, asks=ASKS)
        self._has_changed = False  # what ``take_news`` says

    @property
    def _has_said(self) -> bool:
        return AFTER in self._values and ACTION in self._values

    @property
    def is_unknown(self) -> bool:
        """Whether it was asked for, and did not say."""
        return bool(self._names) and not self._asks_left and not self._has_said

    @property
    def awaits_answer(self) -> bool:
        """Whether what it does is being asked for, and nobody knows it yet."""
        missing = [n for n in self._names if n not in self._values and self._matters(n)]
        return bool(self._asks_left and missing)

    @property
    def stands(self) -> bool:
        """Whether the vehicle has said that it stands when setpoints stop."""
        return self._has_said and not self.why_off

    @property
    def why_off(self) -> str:
        """Return in words why it would not stand without us; "": it does, or is unknown."""
        return self._fault()[1]

    @property
    def to_be_set(self) -> str:
        """Return the parameter that has to be as in STANDING for that; "": none."""
        return self._fault()[0]

    def _fault(self) -> tuple[str, str]:
        after, action = self._values.get(AFTER, 0.0), self._values.get(ACTION)
        if action is not None:
            words, deed = self._deed_of(int(action))
            if deed is not None and deed not in STANDS:
                return ACTION, f"{words}: {deed.value}"
        if not after <= LONGEST:
            return AFTER, f"{AFTER} is {after:g} s, more than {LONGEST:g}"
        station = OF_ABSENCE.get(int(self._values.get(NO_STATION, 0.0)), Deed.HOLD)
        if station in STANDS or int(self._values.get(EXCEPT, 0.0)) & OFFBOARD_BIT:
            return "", ""
        return NO_STATION, f"{NO_STATION} is {self._values[NO_STATION]:g}: {station.value}"

    @property
    def what_it_does(self) -> str:
        """Return in words what the vehicle does when setpoints stop, as far as it has said."""
        if not self._has_said:
            return ""
        if self.why_off:
            return f"{KEEPS_MOVING}: {self.why_off}"
        _, deed = self._deed_of(int(self._values[ACTION]))
        return "stops when setpoints stop" + ("" if deed is None else f": {deed.value}")

    def requests(self) -> list[ParamRequestRead]:
        """Return what is to be asked now; called about once a second."""
        requests = super().requests()
        self._has_changed |= bool(requests) and self.is_unknown
        return requests

    def receive(self, message: ParamValue) -> None:
        """Take in a parameter of the vehicle; whoever asked for it, or changed it."""
        before = self.why_off
        super().receive(message)
        self._has_changed |= self.why_off != before

    def take_news(self) -> str:
        """Return in words what is known anew, "" if nothing is."""
        if not self._has_changed:
            return ""
        self._has_changed = False
        if self.is_unknown:
            return "does not report whether it stops when setpoints stop"
        return self.what_it_does or "stops when setpoints stop"

    def _matters(self, name: str) -> bool:
        """Return whether to ask: few firmwares have what says what is excepted."""
        without_station = OF_ABSENCE.get(int(self._values.get(NO_STATION, 0.0)), Deed.HOLD)
        return name != EXCEPT or without_station not in STANDS

    def _deed_of(self, action: int) -> tuple[str, Deed | None]:
        """Return which parameters decide, in words, and what is done; None: that is not known."""
        words = f"{ACTION} is {action}"
        if action in OF_LOSS:
            return words, OF_LOSS[action]
        without = self._values.get(NO_STICKS)
        if without is None:
            return words, None
        return f"{words}, {NO_STICKS} {without:g}", OF_ABSENCE.get(int(without), Deed.NOTHING)
