"""A command on its way through the server: who asked what of which vehicle, and the way back."""

from collections.abc import Hashable
from typing import Self

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.goals import CHANGE_MODE, marks_of, reposition_flags
from mav_tasks.engine.commands.words import kind_of, row_said
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import (
    NO_MESSAGE,
    Answer,
    Command,
    CommandReceiver,
    Pending,
)
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Marks, Submitter


class CommandRequest:
    """One command of one client to one vehicle; to be answered exactly once."""

    def __init__(
        self, client: GcsClient, vehicle: Vehicle, packet: Packet, pending: Pending
    ) -> None:
        self.client = client
        self.vehicle = vehicle
        self.packet = packet
        self.pending = pending
        #: who asks, and what he may do: later the endpoint may have signed with another key
        self.submitter: Submitter = client.who
        self.rights = client.rights
        #: what is remembered of who asks
        self.sender = client.sender(packet.source)
        #: what is asked for
        self.command = command = pending.command
        #: what that is by the policy table
        self.row = row_said(command)
        self.kind = kind_of(command, self.row, vehicle.parts.persona)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.command}, by {self.submitter})"

    @property
    def actor(self) -> str:
        """Who asks, in words."""
        return str(self.submitter)

    @property
    def receiver(self) -> CommandReceiver:
        """The memory of what this client asked before."""
        return self.sender.commands

    @property
    def answering(self) -> Address:
        """The component that answers: the one addressed; where that is all, our own."""
        target, ours = self.command.target, self.vehicle.server_address
        if target.component_id in (0, ours.component_id):
            return ours
        return Address(ours.system_id, target.component_id)

    @property
    def answers_to(self) -> Hashable:
        """What one answer is enough for, however often it was asked."""
        return self.client.key, type(self), self.command.command, self.answering

    @property
    def marks(self) -> Marks:
        """By what it is recognised when it comes again."""
        return marks_of(self.command, self.packet.raw)

    @property
    def is_go_to(self) -> bool:
        """Whether it is an operator's "go to" at the autopilot: one that changes the mode."""
        command = self.command
        return (
            command.command == MavCmd.DO_REPOSITION
            and command.target.component_id == AUTOPILOT
            and bool(reposition_flags(command) & CHANGE_MODE)
        )

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Acknowledge it."""
        self.pending.answer = Answer(self.command.command, result, result_param2, self.answering)
        self.client.answer(self.pending.answer, self.packet.source)

    def refuse(
        self, refusal: Rejection, *, result: MavResult | None = None, now: float
    ) -> SubmissionRefused:
        """Answer with the reason's code and say it in words; gives it for the audit log.

        ``result``: None is what follows from the reason.
        """
        if result is None:
            result = translate.result_of(refusal.reason)
        self.answer(result, refusal.reason)
        self.client.tell_refusal(refusal.text, self.vehicle.server_address, now=now)
        reason = TaskReason(refusal.reason)
        return SubmissionRefused(
            self.vehicle.system_id, self.command.command, reason, refusal.text, self.actor, now
        )

    def tell(self, text: str, severity: MavSeverity, *, now: float) -> None:
        """Say something to the client, in the name of the vehicle's task server."""
        self.client.tell(text, severity, self.vehicle.server_address, now=now)


class MessageRequest(CommandRequest):
    """The same as asked by the message SET_MODE, which nothing acknowledges."""

    @classmethod
    def of(cls, client: GcsClient, vehicle: Vehicle, packet: Packet, mode: int) -> Self:
        """Return the wish for a mode, by its number."""
        target = Address(vehicle.system_id, AUTOPILOT)
        params = (*vehicle.persona.mode_params(mode), 0.0, 0.0, 0.0, 0.0)
        command = Command(target, MavCmd.DO_SET_MODE, params, 0, None, NO_MESSAGE)
        return cls(client, vehicle, packet, Pending(command, packet.raw, 0.0))

    @property
    def marks(self) -> Marks:
        """None: a ground station sends it again and again, and means it once."""
        return Marks()

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Do nothing: heartbeats show the mode."""
