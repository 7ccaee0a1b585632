"""What a vehicle tells of failsafes of its own: which of them has changed its mode, if any did.

Its text may come before the heartbeat that shows the mode, or after it; of its fence no text tells,
but SYS_STATUS, at 1 Hz.
"""

from math import inf
from typing import NamedTuple

from mav_tasks.engine.vehicles.own_fence import is_breached
from mav_tasks.engine.vehicles.vehicle_texts import VehicleTexts
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Statustext, SysStatus

FENCE = "its own fence"
TOLD_WITHIN = 1.5  # s after a change of mode in which it is told why


class News(NamedTuple):
    """What a message has told."""

    #: in words, why the mode was changed a moment ago; "" if it does not say
    cause: str = ""
    #: whether the vehicle is outside its own fence; None: as before
    is_outside: bool | None = None


class OwnFailsafes:
    """The failsafes of one vehicle, as far as it has told of them."""

    def __init__(self) -> None:
        self._texts = VehicleTexts()
        self.is_outside_fence = False
        self._changed_at = -inf  # the mode, and nobody has said why

    def __repr__(self) -> str:
        return f"OwnFailsafes({self._texts!r}, outside={self.is_outside_fence})"

    def why_not_ready(self, *, now: float) -> str:
        """Return in its own words why it does not arm, "" if it has not said so lately."""
        return self._texts.why_not_ready(now=now)

    def mode_changed(self, *, now: float) -> str:
        """Return in words which failsafe has changed the mode; "" if it has told of none so far."""
        cause = self._texts.failsafe(now=now) or (FENCE if self.is_outside_fence else "")
        self._changed_at = -inf if cause else now
        return cause

    def receive_text(self, sender: Address, message: Statustext, *, now: float) -> News:
        """Take in a text of the vehicle, or a piece of one."""
        if not self._texts.receive(sender, message, now=now):
            return News()
        return News(self._explained(self._texts.failsafe(now=now), now=now))

    def receive_status(self, message: SysStatus, *, now: float) -> News:
        """Take in what the vehicle says of its fence."""
        was_outside, self.is_outside_fence = self.is_outside_fence, is_breached(message)
        if self.is_outside_fence is was_outside:
            return News()
        cause = self._explained(FENCE, now=now) if self.is_outside_fence else ""
        return News(cause, self.is_outside_fence)

    def _explained(self, cause: str, *, now: float) -> str:
        is_just_now, self._changed_at = now - self._changed_at <= TOLD_WITHIN, -inf
        return cause if is_just_now else ""
