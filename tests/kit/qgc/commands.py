"""Commands to one vehicle: queueing, retries, acks and popups."""

from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.core import Core
from tests.kit.qgc.wire import Message

CHECK_EACH = 0.5  # s [2.2]
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, DO_MOTOR_TEST = 512, 511, 209
#: [2.2]; all others are sent once. REQUEST_AUTOPILOT_CAPABILITIES, PREFLIGHT_STORAGE and
#: RUN_PREARM_CHECKS are not used here
REPEATED = frozenset({REQUEST_MESSAGE, 520, 245, 401})
TRIES = 3
MAY_OVERLAP = frozenset({DO_MOTOR_TEST, SET_MESSAGE_INTERVAL})  # [2.2]

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = range(6)
#: [2.3], [11.6]; other results show nothing
WORDS = {
    TEMPORARILY_REJECTED: "command temporarily rejected",
    DENIED: "command denied",
    UNSUPPORTED: "command not supported",
    FAILED: "command failed",
}

#: called with the result, or None without an answer
Handler = Callable[[int | None], None]


@dataclass(slots=True)
class Command:
    """One command, under way or over."""

    message: Message
    component: int
    number: int
    at: float
    max_tries: int
    shows_errors: bool
    handler: Handler | None
    tries: int = 1
    result: int | None = None
    acked_at: float | None = None

    @property
    def took(self) -> float:
        """Seconds until the ack."""
        assert self.acked_at is not None, f"no ack: {self.message}"
        return self.acked_at - self.at


class CommandQueue:
    """The commands of one vehicle."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._pending: list[Command] = []
        self._is_checking = False
        self.sent: list[Command] = []
        self._silent_modes_until = 0.0

    def send_long(
        self,
        number: int,
        *params: float,
        component: int = 1,
        shows_errors: bool = True,
        handler: Handler | None = None,
    ) -> Command:
        """Send a COMMAND_LONG; missing params are 0."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        message = mavlink.MAVLink_command_long_message(
            self._core.system, component, number, 0, *filled
        )
        return self._send(message, component, number, shows_errors, handler)

    def send_int(
        self,
        number: int,
        *params: float,
        frame: int,
        x: int,
        y: int,
        z: float,
        component: int = 1,
        shows_errors: bool = True,
        handler: Handler | None = None,
    ) -> Command:
        """Send a COMMAND_INT."""
        filled = (*params, *(0.0,) * (4 - len(params)))
        message = mavlink.MAVLink_command_int_message(
            self._core.system, component, frame, number, 0, 0, *filled, x, y, z
        )
        return self._send(message, component, number, shows_errors, handler)

    def expect_mode_ack(self) -> None:
        """Note that SET_MODE was sent: for 2 s, an autopilot's ack of it is ignored [11.9]."""
        self._silent_modes_until = self._core.timers.now + 2.0

    def receive(self, ack: Message, component: int) -> None:
        """Take a COMMAND_ACK: matched by component and number only [2.2], [11.6]."""
        found = next(
            (c for c in self._pending if (c.component, c.number) == (component, ack.command)), None
        )
        if found is None:
            is_of_mode = ack.command in (11, 176)
            if not (is_of_mode and self._core.timers.now <= self._silent_modes_until):
                self._core.violation(f"an ack that nothing waits for: {ack}")
            return
        if ack.result == IN_PROGRESS:
            found.max_tries = 1
            if self._core.profile.in_progress == "restarts":
                found.at = self._core.timers.now
            return
        found.acked_at = self._core.timers.now
        self._end(found, ack.result)

    def _send(
        self, message: Message, component: int, number: int, shows: bool, handler: Handler | None
    ) -> Command:
        assert component != 0, "refused in QGroundControl itself [2.1]"
        tries = TRIES if number in REPEATED else 1
        now = self._core.timers.now
        command = Command(message, component, number, now, tries, shows, handler)
        same = [c for c in self._pending if (c.component, c.number) == (component, number)]
        if same and number not in MAY_OVERLAP:
            if shows:
                self._core.popup(
                    "Unable to send command: Waiting on previous response to same command."
                )
            return command
        self._pending.append(command)
        self.sent.append(command)
        self._core.send(message)
        self._check_later()
        return command

    def _check_later(self) -> None:
        """Schedule a check at the next multiple of half a second, as one common timer does."""
        if self._is_checking or not self._pending:
            return
        self._is_checking = True
        wait = CHECK_EACH - self._core.timers.now % CHECK_EACH
        self._core.timers.after(wait, self._check)

    def _check(self) -> None:
        self._is_checking = False
        now = self._core.timers.now
        for command in list(self._pending):
            if now - command.at <= self._core.profile.ack_timeout:
                continue
            if command.tries < command.max_tries:
                command.tries += 1
                if self._core.profile.restarts_timer:
                    command.at = now
                    command.message.confirmation = command.tries - 1  # [2.2]
                self._core.send(command.message)
            else:
                self._end(command, None)
        self._check_later()

    def _end(self, command: Command, result: int | None) -> None:
        self._pending.remove(command)
        command.result = result
        if command.handler is not None:
            command.handler(result)
        elif command.shows_errors:
            name = f"MAV_CMD({command.number})"
            if result is None:
                self._core.popup(f"Vehicle did not respond to command: {name}")
            elif result in WORDS:
                self._core.popup(f"{name} {WORDS[result]}")
