"""What a vehicle itself says of why it does not arm: STATUSTEXT, whatever its severity.

ArduPilot says "PreArm: …" each 30 s and "Arm: …" at each refusal; PX4 "Preflight Fail: …" and
"Arming denied …". Other texts mean nothing here.
"""

from math import inf

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import Statustext
from mav_tasks.services.text_receiver import Text, TextReceiver

STARTS = ("prearm", "arm:", "preflight fail", "arming denied")
LATELY = 35.0  # s in which a text still holds; ArduPilot repeats it each 30 s


class ArmingTexts:
    """The last such text of one vehicle."""

    def __init__(self) -> None:
        self._receiver = TextReceiver()
        self._words = ""
        self._said_at = -inf

    def __repr__(self) -> str:
        return f"ArmingTexts({self._words!r})"

    def receive(self, sender: Address, message: Statustext, *, now: float) -> None:
        """Take in a text of the vehicle, or a piece of one."""
        for text in (
            *self._receiver.handle_deadline(now=now),
            *self._receiver.receive(sender, message, now=now),
        ):
            self._take(text, now=now)

    def latest(self, *, now: float) -> str:
        """Return what the vehicle has said lately, "" if nothing."""
        return self._words if now - self._said_at <= LATELY else ""

    def _take(self, text: Text, *, now: float) -> None:
        if text.words.lower().startswith(STARTS):
            self._words, self._said_at = text.words.strip(), now
