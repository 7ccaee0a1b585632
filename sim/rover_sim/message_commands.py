"""The commands that request messages: alike on every make but for the result of a refusal."""

from collections.abc import Mapping
from dataclasses import dataclass

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from rover_sim.commands import Action, Command, CommandParts, as_id


@dataclass(frozen=True, slots=True)
class MessageCommands:
    """Sends messages once, or changes their intervals."""

    parts: CommandParts
    unknown_message: MavResult  # answer to REQUEST_MESSAGE
    bad_interval: MavResult  # answer to SET_MESSAGE_INTERVAL
    bad_interval_text: str | None  # STATUSTEXT beside it; {} is the message id
    by_index: Mapping[int, Action]  # REQUEST_MESSAGE that needs param2, by message id

    def actions(self) -> Mapping[int, Action]:
        """Return the command table's entries for these commands."""
        return {
            MavCmd.SET_MESSAGE_INTERVAL: self._set_message_interval,
            MavCmd.GET_MESSAGE_INTERVAL: self._get_message_interval,
            MavCmd.REQUEST_MESSAGE: self._request_message,
            MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: self._request_capabilities,
            MavCmd.GET_HOME_POSITION: lambda _, now: self._send(messages.HomePosition.id, now),
        }

    def _set_message_interval(self, command: Command, now: float) -> MavResult:
        message_id, interval_us = as_id(command.params[0]), command.params[1]
        if self.parts.streams.set_interval(message_id, interval_us, now=now):
            return MavResult.ACCEPTED
        if self.bad_interval_text is not None:
            self.parts.outbox.say(MavSeverity.INFO, self.bad_interval_text.format(message_id))
        return self.bad_interval

    def _get_message_interval(self, command: Command, _now: float) -> MavResult:
        message_id = as_id(command.params[0])
        if message_id < 0:
            return MavResult.FAILED
        interval_us = self.parts.streams.interval_us(message_id)
        self.parts.outbox.send(messages.MessageInterval(message_id & 0xFFFF, interval_us))
        return MavResult.ACCEPTED

    def _request_message(self, command: Command, now: float) -> MavResult | None:
        message_id = as_id(command.params[0])
        action = self.by_index.get(message_id)
        return action(command, now) if action else self._send(message_id, now)

    def _request_capabilities(self, _command: Command, now: float) -> MavResult:
        return self._send(messages.AutopilotVersion.id, now)

    def _send(self, message_id: int, now: float) -> MavResult:
        sent = self.parts.send_now(message_id, now)
        return MavResult.ACCEPTED if sent else self.unknown_message
