"""The modes that a make offers, as AVAILABLE_MODES messages.

MAVLink guide, "Standard Modes Protocol". The list never changes here, so there is no
AVAILABLE_MODES_MONITOR: PX4 sends that only after a first change, and never on request.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from mav_tasks.mavlink import messages as m
from rover_sim.modes import Mode, ModeNumbers

NON_STANDARD, SAFE_RECOVERY, MISSION = 0, 5, 6  # MAV_STANDARD_MODE


@dataclass(frozen=True, slots=True)
class OfferedMode:
    """One mode as a client displays it."""

    mode: Mode
    standard: int  # MAV_STANDARD_MODE
    name: str  # empty for a standard mode: the client names it
    properties: int  # MAV_MODE_PROPERTY


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
