"""What a vehicle reports in STATUSTEXT: why it does not arm, and its failsafes.

ArduPilot says "PreArm: …" each 30 s and "Arm: …" at each refusal; PX4 says "Preflight Fail: …" and
"Arming denied …". A failsafe changes the mode as a person's switch does, and only the text tells
them apart: "EKF failsafe", "GCS Failsafe", "Battery 1 is low 10.50V used 0 mAh" (ArduPilot 4.6.3),
"Failsafe activated" (PX4 1.17). Severities differ, and are ignored.
"""

import re
from math import inf

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Statustext
from mav_tasks.services.text_receiver import Text, TextReceiver

ARMING = ("prearm", "arm:", "preflight fail", "arming denied")
LATELY = 35.0  # s for which such a text counts; ArduPilot repeats it each 30 s
FAILSAFE = re.compile(
    r"failsafe|fence.*breach|breach.*fence|geofence|batter.*\b(low|critical)|low battery",
    re.IGNORECASE,
)
NO_FAILSAFE = re.compile(r"cleared|continuing", re.IGNORECASE)
JUST_NOW = 3.0  # s between the text of a failsafe and the mode that the failsafe sets


class VehicleTexts:
    """The last texts of one vehicle that matter to the server."""

    def __init__(self) -> None:
        self._receiver = TextReceiver()
        self._arming, self._arming_at = "", -inf
        self._failsafe, self._failsafe_at = "", -inf

    def __repr__(self) -> str:
        return f"VehicleTexts({self._arming!r}, {self._failsafe!r})"

    def receive(self, sender: Address, message: Statustext, *, now: float) -> bool:
        """Process a text of the vehicle, or a chunk of one. Return whether it names a failsafe."""
        before = self._failsafe_at
        for text in (
            *self._receiver.handle_deadline(now=now),
            *self._receiver.receive(sender, message, now=now),
        ):
            self._take(text, now=now)
        return self._failsafe_at > before

    def why_not_ready(self, *, now: float) -> str:
        """Return the vehicle's recent text on why it does not arm, or ""."""
        return self._arming if now - self._arming_at <= LATELY else ""

    def failsafe(self, *, now: float) -> str:
        """Return the vehicle's text of just now on a failsafe of its own, or ""."""
        return self._failsafe if now - self._failsafe_at <= JUST_NOW else ""

    def _take(self, text: Text, *, now: float) -> None:
        words = text.words.strip()
        if words.lower().startswith(ARMING):
            self._arming, self._arming_at = words, now
        elif FAILSAFE.search(words) and not NO_FAILSAFE.search(words):
            self._failsafe, self._failsafe_at = words, now
