"""How a PX4 rover lands: it counts as landed at the end of a return, then disarms itself."""

from mav_tasks.mavlink.enums import MavSeverity
from rover_sim.outbox import Outbox

LANDED_AFTER = 0.5  # s, of its land detector's hysteresis


class Landing:
    """Land detector of an armed rover that returns or lands."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._there_since: float | None = None
        self.has_landed = False

    def __repr__(self) -> str:
        return f"Landing({'landed' if self.has_landed else 'not landed'})"

    def watch(self, *, is_there: bool, disarm_after: float, now: float) -> bool:
        """Return whether to disarm now. ``disarm_after`` in s; 0 or less means never."""
        if not is_there:
            self._there_since, self.has_landed = None, False
            return False
        if self._there_since is None:
            self._there_since = now
        stood = now - self._there_since
        if not self.has_landed and stood >= LANDED_AFTER:
            self.has_landed = True
            self._outbox.say(MavSeverity.INFO, "Landing detected")
        return disarm_after > 0.0 and stood >= LANDED_AFTER + disarm_after
