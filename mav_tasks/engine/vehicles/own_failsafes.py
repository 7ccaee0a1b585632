"""What a vehicle reports about its own failsafes, and why it does not arm.

ArduPilot says "PreArm: …" each 30 s and "Arm: …" at each refusal; PX4 says "Preflight Fail: …" and
"Arming denied …". A failsafe changes the mode as a person's switch does, and only the text tells
them apart: "EKF failsafe", "GCS Failsafe", "Battery 1 is low 10.50V used 0 mAh" (ArduPilot 4.6.3),
"Failsafe activated" (PX4 1.17). Severities differ, and are ignored. The text may come before or
after the heartbeat that shows the mode.

Its fence is reported by no text, but by SYS_STATUS, at 1 Hz: ArduPilot (4.6.3) reports its fence as
healthy unless it is breached, and it stays breached until the rover is back inside or the fence is
switched off. PX4 1.17 has no such bit: only its mode shows a breach.
"""

import re
from math import inf
from typing import NamedTuple

from mav_tasks.engine.services.statustext import TextReceiver
from mav_tasks.engine.services.vehicle_status import is_outside_fence
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Statustext, SysStatus

FENCE = "its own fence"
TOLD_WITHIN = 1.5  # s after a mode change in which the cause may be reported
ARMING = ("prearm", "arm:", "preflight fail", "arming denied")
LATELY = 35.0  # s for which such a text counts; ArduPilot repeats it each 30 s
FAILSAFE = re.compile(
    r"failsafe|fence.*breach|breach.*fence|geofence|batter.*\b(low|critical)|low battery",
    re.IGNORECASE,
)
NO_FAILSAFE = re.compile(r"cleared|continuing", re.IGNORECASE)
JUST_NOW = 3.0  # s between the text of a failsafe and the mode that the failsafe sets


class News(NamedTuple):
    """What a message reports."""

    #: why the mode was changed a moment ago, in words; "" if the message does not say
    cause: str = ""
    #: whether the vehicle is outside its own fence; None if that has not changed
    is_outside: bool | None = None


class OwnFailsafes:
    """The failsafes of one vehicle, as far as it has reported them."""

    def __init__(self) -> None:
        self._receiver = TextReceiver()
        self._arming, self._arming_at = "", -inf
        self._failsafe, self._failsafe_at = "", -inf
        self._said, self._said_at = "", -inf
        self.is_outside_fence = False
        self._changed_at = -inf  # when the mode changed without a known cause

    def __repr__(self) -> str:
        return f"OwnFailsafes({self._arming!r}, {self._failsafe!r}, {self.is_outside_fence})"

    def why_not_ready(self, *, now: float) -> str:
        """Return the vehicle's recent text on why it does not arm, or ""."""
        return self._arming if now - self._arming_at <= LATELY else ""

    def said_since(self, at: float) -> str:
        """Return the vehicle's last text since then, or ""."""
        return self._said if self._said_at >= at else ""

    def mode_changed(self, *, now: float) -> str:
        """Note a mode change. Return the failsafe that caused it, or "" if none is known yet."""
        cause = self._failsafe if now - self._failsafe_at <= JUST_NOW else ""
        cause = cause or (FENCE if self.is_outside_fence else "")
        self._changed_at = -inf if cause else now
        return cause

    def receive_text(self, sender: Address, message: Statustext, *, now: float) -> News:
        """Process a text of the vehicle, or a chunk of one."""
        cause = ""
        for text in (
            *self._receiver.handle_deadline(now=now),
            *self._receiver.receive(sender, message, now=now),
        ):
            words = text.words.strip()
            self._said, self._said_at = words, now
            if words.lower().startswith(ARMING):
                self._arming, self._arming_at = words, now
            elif FAILSAFE.search(words) and not NO_FAILSAFE.search(words):
                self._failsafe = cause = words
                self._failsafe_at = now
        return News(self._explained(cause, now=now))

    def receive_status(self, message: SysStatus, *, now: float) -> News:
        """Process what the vehicle reports about its fence."""
        was_outside, self.is_outside_fence = self.is_outside_fence, is_outside_fence(message)
        if self.is_outside_fence is was_outside:
            return News()
        cause = FENCE if self.is_outside_fence else ""
        return News(self._explained(cause, now=now), self.is_outside_fence)

    def _explained(self, cause: str, *, now: float) -> str:
        """Return a cause, if there is one, that explains a mode change of just now."""
        if not cause:
            return ""
        is_just_now, self._changed_at = now - self._changed_at <= TOLD_WITHIN, -inf
        return cause if is_just_now else ""
