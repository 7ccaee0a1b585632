"""The offboard-loss failsafe of a PX4 rover, as a table.

After the commander of PX4 1.15 to 1.17 (``failsafe.cpp``). COM_OBL_RC_ACT names an action. Its
first three values are modes that need manual control; without it, NAV_RCL_ACT applies instead, at
once: neither COM_FAIL_ACT_T delays it, nor does COM_RCL_EXCEPT disable it. With both at their
defaults (0 and 2) and no sticks, the rover drives home. Only Hold makes it stand.

A NAV_RCL_ACT outside its list (0, or -1) means no action: the rover stays in OFFBOARD and follows
the last setpoint.
"""

from collections.abc import Mapping
from enum import Enum

from rover_sim.flight_rules import Intervention
from rover_sim.modes import Mode


class Action(Enum):
    """The failsafe action, with the commander's own names."""

    NONE = "none"  # the rover drives on
    POSITION = "position"  # manual control
    STABILIZED = "stabilized"  # manual control; here MANUAL
    HOLD = "hold"
    RETURN = "return"
    LAND = "land"  # stops; a rover counts as landed at once, and is disarmed COM_DISARM_LAND later
    TERMINATE = "terminate"  # the real one stays locked until it restarts
    DISARM = "disarm"


STICKS = (Action.POSITION, Action.STABILIZED)  # modes with manual control

#: COM_OBL_RC_ACT. 1 is Altitude, which rovers lack: PX4 falls through to Stabilized.
OFFBOARD_LOST: Mapping[int, Action] = {
    0: Action.POSITION,
    1: Action.STABILIZED,
    2: Action.STABILIZED,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
    6: Action.TERMINATE,
    7: Action.DISARM,
}
#: NAV_RCL_ACT
STICKS_LOST: Mapping[int, Action] = {
    1: Action.HOLD,
    2: Action.RETURN,
    3: Action.LAND,
    5: Action.TERMINATE,
    6: Action.DISARM,
}

INTERVENTIONS: Mapping[Action, Intervention | None] = {
    Action.NONE: None,
    Action.POSITION: Intervention(Mode.POSITION),
    Action.STABILIZED: Intervention(Mode.MANUAL),
    Action.HOLD: Intervention(Mode.HOLD),
    Action.RETURN: Intervention(Mode.RTL),
    Action.LAND: Intervention(Mode.LAND),
    Action.TERMINATE: Intervention(disarm=True),
    Action.DISARM: Intervention(disarm=True),
}


def action_on_loss(offboard_loss: int, stick_loss: int, *, sticks: bool) -> Action:
    """Return the action of COM_OBL_RC_ACT and NAV_RCL_ACT; ``sticks``: manual control is present.

    An unknown COM_OBL_RC_ACT counts as 0.
    """
    action = OFFBOARD_LOST.get(offboard_loss, Action.POSITION)
    if action in STICKS and not sticks:
        return STICKS_LOST.get(stick_loss, Action.NONE)
    return action
