"""What moves a rover, and whether the new core moves one that the old core leaves alone.

After an intended difference the rover of the record does not do what the new core says, and the
packets of the two runs cannot be compared any more. That the new core drives, arms or lets go no
rover which stands in the record can be seen all the same.
"""

from collections.abc import Iterable, Iterator
from math import isfinite

from .wire import Sent

#: s after the last packet of the old core that moves a rover: so much later the new one may be
LATER = 5.0
#: m/s and rad/s: a set-point that means "stand" may name as much, lest it be taken for none
STANDING = 0.002
HOLD_MODES = ((4.0, 0.0), (4.0, 3.0))  # param2 and param3 of ArduPilot's HOLD and of PX4's
SETPOINTS = ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT")
ARM, SET_MODE, REPOSITION = 400, 176, 192
NO_PLACE = 2_147_483_647  # x and y of a COMMAND_INT


def moves(sent: Sent) -> bool:
    """Whether a packet to a rover drives it, arms it, or sets a mode in which it may drive."""
    values = sent.fields
    if sent.name in SETPOINTS:
        speeds = (values["vx"], values["vy"], values["yaw_rate"])
        return any(isfinite(speed) and abs(speed) > STANDING for speed in speeds)
    if sent.name in ("COMMAND_LONG", "COMMAND_INT"):
        if values["command"] == ARM:
            return bool(values["param1"])
        return bool(values["command"] == SET_MODE) and not asks_hold(sent)
    return False


def asks_hold(sent: Sent) -> bool:
    """Whether a packet to a rover asks for HOLD."""
    values = sent.fields
    if sent.name != "COMMAND_LONG" or values["command"] != SET_MODE:
        return False
    return (values["param2"], values["param3"]) in HOLD_MODES


def stands(sent: Sent) -> bool:
    """Whether a packet to a rover lets it stand: a set-point that means so, or HOLD."""
    is_setpoint = sent.name in SETPOINTS and not moves(sent)
    return asks_hold(sent) or is_setpoint or stays_here(sent)


def stays_here(sent: Sent) -> bool:
    """Whether a PX4 is told to hold the place where it is: a DO_REPOSITION without a place."""
    values = sent.fields
    is_reposition = sent.name == "COMMAND_INT" and values["command"] == REPOSITION
    return is_reposition and values["x"] == values["y"] == NO_PLACE


class MotionWatch:
    """Sees to it, after a split, that the new core moves only what the old one moves as well.

    A rover is watched until somebody lets it go and the new core accepts that: from then on its
    tasks are others than those of the old core, and begin at other times.
    """

    def __init__(self) -> None:
        self._moved_at: dict[object, float] = {}
        self._let_go: set[int] = set()  # rovers, since the split

    def old(self, packets: Iterable[Sent], *, now: float) -> None:
        """Note what the old core sends, also before the split."""
        for sent in packets:
            if moves(sent):
                self._moved_at[_rover(sent)] = now

    def let_go(self, system: int) -> None:
        """Note that the new core has accepted a word that lets a rover go, after the split."""
        self._let_go.add(system)

    def unmatched(self, packets: Iterable[Sent], *, now: float) -> Iterator[Sent]:
        """Give what the new core sends to a rover that the old one does not move."""
        for sent in packets:
            if not moves(sent) or sent.fields["target_system"] in self._let_go:
                continue
            if now - self._moved_at.get(_rover(sent), -LATER) > LATER:
                yield sent


def _rover(sent: Sent) -> object:
    return sent.way, sent.fields["target_system"]
