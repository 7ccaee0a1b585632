"""Messages of the flight stack, in order, until the vehicle takes them."""

import math
from operator import itemgetter

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Message
from rover_sim.faults import NO_FAULTS, Faults

TEXT_LENGTH = 50  # bytes of one STATUSTEXT
LAST_TEXT_ID = 65535


class Outbox:
    """Collects messages; a fault can silence it."""

    def __init__(self) -> None:
        self.faults: Faults = NO_FAULTS
        self._messages: list[Message] = []
        self._long_texts = 0  # id of the last text that needed more than one STATUSTEXT
        self._late: list[tuple[float, Message]] = []  # (time to send, message), earliest first

    def send(self, message: Message) -> None:
        """Add a message, unless a fault withholds it."""
        # Not .id: in BATTERY_STATUS and STATUSTEXT a field of that name hides the message's.
        if not self.faults.silent and message.get_msgId() not in self.faults.withheld:
            self._messages.append(message)

    def say(self, severity: MavSeverity, text: str) -> None:
        """Add a text as one STATUSTEXT, or as several with a common id and sequence numbers."""
        pieces = [text[at : at + TEXT_LENGTH] for at in range(0, len(text), TEXT_LENGTH)]
        if len(pieces) > 1:
            self._long_texts = self._long_texts % LAST_TEXT_ID + 1
        number = self._long_texts if len(pieces) > 1 else 0
        for sequence, piece in enumerate(pieces):
            self.send(messages.Statustext(severity, piece.encode(), number, sequence))

    def inform(self, text: str) -> None:
        """Add a STATUSTEXT of severity INFO."""
        self.say(MavSeverity.INFO, text)

    def send_at(self, message: Message, at: float, now: float) -> None:
        """Add a message at time ``at``; the owner of the clock calls ``release``."""
        if at <= now:
            self.send(message)
            return
        self._late.append((at, message))
        self._late.sort(key=itemgetter(0))

    @property
    def next_release(self) -> float:
        """Time at which ``release`` is due; infinity if nothing is delayed."""
        return self._late[0][0] if self._late else math.inf

    def release(self, now: float) -> None:
        """Add the delayed messages that are due."""
        while self._late and self._late[0][0] <= now:
            self.send(self._late.pop(0)[1])

    def take(self) -> list[Message]:
        """Return the collected messages and forget them."""
        taken, self._messages = self._messages, []
        return taken
