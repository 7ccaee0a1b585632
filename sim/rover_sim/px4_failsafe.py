"""What a PX4 rover does when its setpoints end: the whole decision, as a table.

After the commander of PX4 1.15 to 1.17 (``failsafe.cpp``). COM_OBL_RC_ACT names an action. Its
first three are modes that need a person's sticks; where no manual control is heard, NAV_RCL_ACT
counts instead, at once: COM_FAIL_ACT_T delays it as little as COM_RCL_EXCEPT excepts it. With both
at their defaults (0 and 2) and no sticks, that is a drive home. Only Hold stands.

A NAV_RCL_ACT outside of its list (0, or -1) is no action at all: the rover stays in OFFBOARD and
drives on as the last setpoint said.
"""

from collections.abc import Mapping
from enum import Enum

from rover_sim.flight_rules import Intervention
from rover_sim.modes import Mode


class Action(Enum):
    """What follows, by the commander's own names."""

    NONE = "none"  # it drives on
    POSITION = "position"  # the sticks steer
    STABILIZED = "stabilized"  # the sticks steer; here MANUAL
    HOLD = "hold"
    RETURN = "return"
    LAND = "land"  # it stands; a rover has landed at once, and is disarmed COM_DISARM_LAND later
    TERMINATE = "terminate"  # the real one stays locked until it is started again
    DISARM = "disarm"


STICKS = (Action.POSITION, Action.STABILIZED)  # modes that a person drives in

#: COM_OBL_RC_ACT. 1 is Altitude, which no rover has: it falls through to Stabilized.
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
    """Return what COM_OBL_RC_ACT and NAV_RCL_ACT make it do; ``sticks``: somebody holds some.

    A COM_OBL_RC_ACT that there is not counts as 0.
    """
    action = OFFBOARD_LOST.get(offboard_loss, Action.POSITION)
    if action in STICKS and not sticks:
        return STICKS_LOST.get(stick_loss, Action.NONE)
    return action
