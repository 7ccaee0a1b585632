"""The shared objects of the station's parts: time, screen, output."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.kit.qgc.popups import Screen, Shown
from tests.kit.qgc.profile import Profile
from tests.kit.qgc.timers import Timers
from tests.kit.qgc.wire import Message

AUTOPILOT = 1  # component


@dataclass(frozen=True, slots=True)
class Core:
    """Passed to each part; ``system`` is the part's vehicle."""

    profile: Profile
    timers: Timers
    screen: Screen
    send: Callable[[Message], None]
    system: int

    def popup(self, text: str) -> None:
        """Show a popup."""
        self.screen.popups.append(Shown(self.timers.now, text))

    def violation(self, text: str) -> None:
        """Record a problem that the person does not see."""
        self.screen.violations.append(Shown(self.timers.now, text))
