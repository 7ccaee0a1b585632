"""A command on its way through the server: who asked what of which vehicle, and the way back."""

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Self

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.rights import Rights
from mav_tasks.engine.clients.sender import Sender
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.goals import CHANGE_MODE, marks_of, reposition_flags
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


@dataclass(frozen=True, slots=True)
class Asked:
    """One command of one client to one vehicle; to be answered exactly once."""

    client: GcsClient
    vehicle: Vehicle
    packet: Packet
    pending: Pending
    #: who asks, and what he may do: later the endpoint may have signed with another key
    submitter: Submitter = field(init=False)
    rights: Rights = field(init=False)
    command: Command = field(init=False)  #: what is asked for

    def __post_init__(self) -> None:
        object.__setattr__(self, "submitter", self.client.submitter(self.packet.source))
        object.__setattr__(self, "rights", self.client.rights)
        object.__setattr__(self, "command", self.pending.command)

    @property
    def actor(self) -> str:
        """Who asks, in words."""
        return str(self.submitter)

    @property
    def sender(self) -> Sender:
        """What is remembered of who asks."""
        return self.client.sender(self.packet.source)

    @property
    def receiver(self) -> CommandReceiver:
        """The memory of what this client asked before."""
        return self.sender.commands

    @property
    def answering(self) -> Address:
        """The component that answers: the one addressed; where that is all, our own."""
        component = self.command.target.component_id or self.vehicle.server_component
        return Address(self.vehicle.system_id, component)

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


@dataclass(frozen=True, slots=True)
class AskedByMessage(Asked):
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
