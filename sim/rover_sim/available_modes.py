"""The modes that a make offers, as AVAILABLE_MODES messages.

MAVLink guide, "Standard Modes Protocol". The list never changes here, so there is no
AVAILABLE_MODES_MONITOR: PX4 sends that only after a first change, and never on request.
"""

from collections.abc import Iterable
from typing import NamedTuple

from mav_tasks.mavlink import messages as m
from rover_sim.modes import Mode, ModeNumbers

NON_STANDARD, SAFE_RECOVERY, MISSION = 0, 5, 6  # MAV_STANDARD_MODE
ADVANCED = 1  # MAV_MODE_PROPERTY


class OfferedMode(NamedTuple):
    """One mode as a client displays it."""

    mode: Mode
    standard: int  # MAV_STANDARD_MODE
    name: str  # empty for a standard mode: the client names it
    properties: int  # MAV_MODE_PROPERTY


#: in the order of PX4's navigation states; PX4 marks all but POSITION as advanced
PX4_OFFERED = (
    OfferedMode(Mode.MANUAL, NON_STANDARD, "Manual", ADVANCED),
    OfferedMode(Mode.POSITION, NON_STANDARD, "Position", 0),
    OfferedMode(Mode.AUTO, MISSION, "", ADVANCED),
    OfferedMode(Mode.HOLD, NON_STANDARD, "Hold", ADVANCED),
    OfferedMode(Mode.RTL, SAFE_RECOVERY, "", ADVANCED),
    OfferedMode(Mode.GUIDED, NON_STANDARD, "Offboard", ADVANCED),
)


def available_modes(
    offered: Iterable[OfferedMode], modes: ModeNumbers
) -> tuple[m.AvailableModes, ...]:
    """Return the messages in the order of their index, from 1; none if nothing is offered."""
    listed = tuple(offered)
    return tuple(
        m.AvailableModes(
            len(listed),
            index,
            each.standard,
            modes.numbers[each.mode],
            each.properties,
            each.name.encode(),
        )
        for index, each in enumerate(listed, start=1)
    )


def standard_mode_of(mode: Mode, offered: Iterable[OfferedMode]) -> int:
    """Return a mode's MAV_STANDARD_MODE; NON_STANDARD also for a mode that is not offered."""
    return next((each.standard for each in offered if each.mode is mode), NON_STANDARD)
