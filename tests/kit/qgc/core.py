"""What every part of the station has in common: its time, its screen, its way out."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.kit.qgc.popups import Screen, Shown
from tests.kit.qgc.profile import Profile
from tests.kit.qgc.timers import Timers
from tests.kit.qgc.wire import Message

AUTOPILOT = 1  # component


@dataclass(frozen=True, slots=True)
class Core:
    """Handed to each part. ``system`` is the vehicle that the part is about."""

    profile: Profile
    timers: Timers
    screen: Screen
    send: Callable[[Message], None]
    system: int

    def popup(self, text: str) -> None:
        """Show a popup."""
        self.screen.popups.append(Shown(self.timers.now, text))

    def violation(self, text: str) -> None:
        """Note what the person does not see, and what must not be all the same."""
        self.screen.violations.append(Shown(self.timers.now, text))
