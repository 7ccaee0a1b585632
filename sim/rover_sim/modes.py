"""What a flight stack can be doing; every make has its own numbers and names for it."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Mode(Enum):
    """A mode, named as on ArduPilot; PX4's name follows where it is another."""

    INITIALISING = "initialising"
    MANUAL = "manual"
    POSITION = "position"  # sticks, as MANUAL; ArduPilot Rover has none, PX4: POSCTL
    HOLD = "hold"  # PX4: AUTO.LOITER
    AUTO = "auto"  # PX4: AUTO.MISSION
    RTL = "rtl"
    LAND = "land"  # PX4: AUTO.LAND; a rover stands in it, and is disarmed
    GUIDED = "guided"  # follows setpoints; PX4: OFFBOARD


@dataclass(frozen=True, slots=True)
class ModeNumbers:
    """The modes of one make."""

    numbers: Mapping[Mode, int]  # HEARTBEAT.custom_mode
    first: Mode  # right after switching on

    def mode_of(self, custom_mode: int) -> Mode | None:
        """Return the mode of a number, or None if there is no such mode."""
        return next((mode for mode, n in self.numbers.items() if n == custom_mode), None)
