"""What the flight stack has to say, in order, until the vehicle takes it."""

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Message
from rover_sim.faults import NO_FAULTS, Faults

TEXT_LENGTH = 50  # bytes of one STATUSTEXT


class Outbox:
    """Collects messages; a fault can silence it."""

    def __init__(self) -> None:
        self.faults: Faults = NO_FAULTS
        self._messages: list[Message] = []

    def __repr__(self) -> str:
        return f"Outbox({len(self._messages)} waiting)"

    def send(self, message: Message) -> None:
        """Add a message, unless a fault withholds it."""
        # Not .id: in BATTERY_STATUS and STATUSTEXT a field of that name hides the message's.
        if not self.faults.silent and message.get_msgId() not in self.faults.withheld:
            self._messages.append(message)

    def say(self, severity: MavSeverity, text: str) -> None:
        """Add a STATUSTEXT; every text of the flight stack fits into one."""
        self.send(messages.Statustext(severity, text.encode()[:TEXT_LENGTH]))

    def take(self) -> list[Message]:
        """Hand over what was collected."""
        taken, self._messages = self._messages, []
        return taken
