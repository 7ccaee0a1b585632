"""What a vehicle reports about its own failsafes: which one, if any, changed its mode.

The text may come before or after the heartbeat that shows the mode. Its fence is reported by no
text, but by SYS_STATUS, at 1 Hz: ArduPilot (4.6.3) reports its fence as healthy unless it is
breached, and it stays breached until the rover is back inside or the fence is switched off. PX4
1.17 has no such bit: only its mode shows a breach.
"""

from math import inf
from typing import NamedTuple

from mav_tasks.engine.vehicles.vehicle_texts import VehicleTexts
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Statustext, SysStatus

GEOFENCE = 0x100000  # MAV_SYS_STATUS_GEOFENCE
FENCE = "its own fence"
TOLD_WITHIN = 1.5  # s after a mode change in which the cause may be reported


class News(NamedTuple):
    """What a message reports."""

    #: why the mode was changed a moment ago, in words; "" if the message does not say
    cause: str = ""
    #: whether the vehicle is outside its own fence; None if that has not changed
    is_outside: bool | None = None


class OwnFailsafes:
    """The failsafes of one vehicle, as far as it has reported them."""

    def __init__(self) -> None:
        self.texts = VehicleTexts()
        self.is_outside_fence = False
        self._changed_at = -inf  # when the mode changed without a known cause

    def __repr__(self) -> str:
        return f"OwnFailsafes({self.texts!r}, outside={self.is_outside_fence})"

    def mode_changed(self, *, now: float) -> str:
        """Note a mode change. Return the failsafe that caused it, or "" if none is known yet."""
        cause = self.texts.failsafe(now=now) or (FENCE if self.is_outside_fence else "")
        self._changed_at = -inf if cause else now
        return cause

    def receive_text(self, sender: Address, message: Statustext, *, now: float) -> News:
        """Process a text of the vehicle, or a chunk of one."""
        if not self.texts.receive(sender, message, now=now):
            return News()
        return News(self._explained(self.texts.failsafe(now=now), now=now))

    def receive_status(self, message: SysStatus, *, now: float) -> News:
        """Process what the vehicle reports about its fence."""
        was_outside, self.is_outside_fence = self.is_outside_fence, is_breached(message)
        if self.is_outside_fence is was_outside:
            return News()
        cause = self._explained(FENCE, now=now) if self.is_outside_fence else ""
        return News(cause, self.is_outside_fence)

    def _explained(self, cause: str, *, now: float) -> str:
        is_just_now, self._changed_at = now - self._changed_at <= TOLD_WITHIN, -inf
        return cause if is_just_now else ""


def is_breached(status: SysStatus) -> bool:
    """Return whether a fence that is switched on is reported as unhealthy."""
    is_on = status.onboard_control_sensors_enabled & GEOFENCE
    return bool(is_on) and not status.onboard_control_sensors_health & GEOFENCE
