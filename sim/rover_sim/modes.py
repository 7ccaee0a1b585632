"""The modes of a flight stack; every make has its own numbers and names."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Mode(Enum):
    """A mode, named as on ArduPilot; a comment gives PX4's name if it differs."""

    INITIALISING = "initialising"
    MANUAL = "manual"
    POSITION = "position"  # manual control, like MANUAL; ArduPilot Rover has none, PX4: POSCTL
    HOLD = "hold"  # PX4: AUTO.LOITER
    AUTO = "auto"  # PX4: AUTO.MISSION
    RTL = "rtl"
    LAND = "land"  # PX4: AUTO.LAND; a rover stands in it, and is disarmed
    GUIDED = "guided"  # follows setpoints; PX4: OFFBOARD


@dataclass(frozen=True, slots=True)
class ModeNumbers:
    """The mode numbers of one make."""

    numbers: Mapping[Mode, int]  # HEARTBEAT.custom_mode
    first: Mode  # after power-on

    def mode_of(self, custom_mode: int) -> Mode | None:
        """Return the mode with this number, or None if there is no such mode."""
        return next((mode for mode, n in self.numbers.items() if n == custom_mode), None)
