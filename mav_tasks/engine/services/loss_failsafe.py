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

AFTER, ACTION = "COM_OF_LOSS_T", "COM_OBL_RC_ACT"  # s; what is done then
NO_STICKS = "NAV_RCL_ACT"
NO_STATION, EXCEPT = "NAV_DLL_ACT", "COM_DLL_EXCEPT"
OFFBOARD_BIT = 4  # of COM_DLL_EXCEPT
#: how the description of a vehicle begins that does not stop by itself
KEEPS_MOVING = "keeps moving when setpoints stop"
STOPS = "stops when setpoints stop"
LONGEST = 5.0  # s that a vehicle may drive on without setpoints; ArduPilot takes 3
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
OF_ABSENCE: Mapping[int, Deed] = {  # NAV_RCL_ACT and NAV_DLL_ACT
    1: Deed.HOLD,
    2: Deed.RETURN,
    3: Deed.LAND,
    5: Deed.OFF,
    6: Deed.OFF,
}
OF_LOSS: Mapping[int, Deed] = {  # COM_OBL_RC_ACT; what is not listed asks for sticks
    -1: Deed.NOTHING,
    3: Deed.RETURN,
    4: Deed.LAND,
    5: Deed.HOLD,
    6: Deed.OFF,
    7: Deed.OFF,
}


def is_said(values: Mapping[str, float]) -> bool:
    """Return whether a vehicle's parameters say what it does when setpoints stop."""
    return AFTER in values and ACTION in values


def fault_in(values: Mapping[str, float]) -> tuple[str, str]:
    """Return which of STANDING is wrong, and in words why it would not stand; "": none known."""
    after, action = values.get(AFTER, 0.0), values.get(ACTION)
    if action is not None:
        words, deed = _deed_of(int(action), values)
        if deed is not None and deed not in STANDS:
            return ACTION, f"{words}: {deed.value}"
    if not after <= LONGEST:
        return AFTER, f"{AFTER} is {after:g} s, more than {LONGEST:g}"
    if is_asked_for(EXCEPT, values) and not int(values.get(EXCEPT, 0.0)) & OFFBOARD_BIT:
        station = values[NO_STATION]
        return NO_STATION, f"{NO_STATION} is {station:g}: {OF_ABSENCE[int(station)].value}"
    return "", ""


def what_it_does(values: Mapping[str, float]) -> str:
    """Return in words what a vehicle does when setpoints stop, as far as it has said."""
    if not is_said(values):
        return ""
    if why_off := fault_in(values)[1]:
        return f"{KEEPS_MOVING}: {why_off}"
    _, deed = _deed_of(int(values[ACTION]), values)
    return STOPS + ("" if deed is None else f": {deed.value}")


def is_asked_for(name: str, values: Mapping[str, float]) -> bool:
    """Return whether a parameter counts: few firmwares have what says what is excepted."""
    without_station = OF_ABSENCE.get(int(values.get(NO_STATION, 0.0)), Deed.HOLD)
    return name != EXCEPT or without_station not in STANDS


def _deed_of(action: int, values: Mapping[str, float]) -> tuple[str, Deed | None]:
    """Return which parameters decide, in words, and what is done; None: that is not known."""
    words = f"{ACTION} is {action}"
    if action in OF_LOSS:
        return words, OF_LOSS[action]
    without = values.get(NO_STICKS)
    if without is None:
        return words, None
    return f"{words}, {NO_STICKS} {without:g}", OF_ABSENCE.get(int(without), Deed.NOTHING)
