"""A client's command while the server handles it: its kind, sender, vehicle and answer."""

from collections.abc import Hashable, Iterator
from typing import Self

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.sender import Said
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.goals import marks_of
from mav_tasks.engine.policy import (
    COMMANDS,
    DISARM,
    PAUSE,
    PAUSE_HERE,
    Kind,
    Row,
    row_of_command,
)
from mav_tasks.engine.services.commands import NO_MESSAGE, REPEATED, Answer, Command
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds.goto import CHANGE_MODE, reposition_flags
from mav_tasks.kinds.params import has_place
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Marks, Submitter

#: commands whose parameters decide their row
AMBIGUOUS = frozenset({MavCmd.COMPONENT_ARM_DISARM, MavCmd.DO_PAUSE_CONTINUE, MavCmd.DO_REPOSITION})
SET_MODE = int(MavCmd.DO_SET_MODE)
#: commands that end tasks: a copy must not end later ones
OF_ONE_TASK = (MavCmd.TASK_CANCEL, MavCmd.TASK_CLEAR)


def row_said(command: Command) -> Row:
    """Return the row of a command by its content; ``ModeRequests`` looks closer at modes."""
    if command.command in AMBIGUOUS:
        match command.command, command.params[0]:
            case MavCmd.COMPONENT_ARM_DISARM, 0.0:
                return DISARM
            case MavCmd.DO_PAUSE_CONTINUE, 0.0:
                return PAUSE
            case MavCmd.DO_REPOSITION, _ if not has_place(command):
                return PAUSE_HERE
    return COMMANDS.get(command.command) or row_of_command(command.command)


def kind_of(command: Command, row: Row, vehicle: Vehicle) -> Kind:
    """Return the kind of a command with this row; HOLD is a HALT, any other mode a GO."""
    if command.command != SET_MODE:
        return row.kind
    persona = vehicle.parts.persona
    return Kind.HALT if persona.mode_in(*command.params[1:3]) == persona.hold_mode else Kind.GO


def halts_again(command: Command, vehicle: Vehicle, *, after: float) -> bool:
    """Whether a command is executed again when the same packet comes ``after`` so many seconds.

    Every halt is: some senders do not count their packets, so it may be a new command. TASK_CANCEL
    by id is not, as it means one task. TASK_CANCEL without an id and TASK_CLEAR are executed again
    after REPEATED seconds, when they mean other tasks.
    """
    if command.command in OF_ONE_TASK:
        is_by_id = command.command == MavCmd.TASK_CANCEL and command.params[0] != 0.0
        return after > REPEATED and not is_by_id
    return kind_of(command, row_said(command), vehicle) is Kind.HALT


class CommandRequest:
    """One command of one client to one vehicle, to be answered exactly once."""

    vehicle: Vehicle
    #: the component that answers: the target, or the task server for target 0
    answering: Address

    def __init__(
        self, client: GcsClient, vehicle: Vehicle | None, packet: Packet, said: Said, row: Row
    ) -> None:
        """``vehicle``: None if it is still to be chosen."""
        self.client = client
        self.packet = packet
        self.said = said
        #: submitter and rights at arrival: later the endpoint may sign with another key
        self.submitter: Submitter = client.who
        self.rights = client.rights
        #: when it arrived, s
        self.arrived = client.arrived
        #: the sender's earlier commands and sequence numbers
        self.sender = said.sender
        #: the parsed message
        self.command = command = said.command
        #: its row in the policy table
        self.row = row
        self.kind = row.kind
        if vehicle is not None:
            self.vehicle = vehicle
            component, ours = command.target.component_id, vehicle.server_address
            is_ours = component in (0, ours.component_id)
            self.answering = ours if is_ours else Address(ours.system_id, component)
            if command.command == SET_MODE:
                self.kind = kind_of(command, row, vehicle)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.command}, by {self.submitter})"

    @property
    def actor(self) -> str:
        """The submitter, as text."""
        return str(self.submitter)

    def earlier(self, *, within: float, now: float) -> Iterator[Said]:
        """Yield the sender's equal commands of the last so many seconds, the latest first."""
        return self.sender.earlier(self.said, within=within, now=now)

    @property
    def refusing(self) -> Address:
        """The component in whose name the text of a refusal is sent."""
        return self.vehicle.server_address

    @property
    def rover(self) -> int:
        """The vehicle's system id."""
        return self.vehicle.system_id

    @property
    def answers_to(self) -> Hashable:
        """Key of requests that one answer is enough for."""
        return self.client.key, type(self), self.command.command, self.answering

    @property
    def marks(self) -> Marks:
        """Keys by which a repeat of this command is recognised."""
        return marks_of(self.command, self.packet.raw)

    @property
    def is_go_to(self) -> bool:
        """Whether this is an operator's "go to": at the autopilot, and changing the mode."""
        command = self.command
        return (
            command.command == MavCmd.DO_REPOSITION
            and command.target.component_id == AUTOPILOT
            and bool(reposition_flags(command) & CHANGE_MODE)
        )

    def is_held(self, result: MavResult) -> bool:
        """Whether ``Submissions.answer_halt`` sends this answer: it is that of a halt in force."""
        return self.kind is Kind.HALT and result in translate.IN_FORCE

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Send the COMMAND_ACK, unless the halt must be kept first."""
        self.said.answer = Answer(self.command.command, result, result_param2, self.answering)
        if self.kind is not Kind.HALT or not self.is_held(result):
            self.client.answer(self.said.answer, self.packet.source)

    def refuse(
        self, refusal: Rejection, *, now: float, result: MavResult | None = None
    ) -> SubmissionRefused:
        """Answer with the reason's code and send its text; return the event for the audit log.

        ``result``: None for the result that follows from the reason.
        """
        if result is None:
            result = translate.result_of(refusal.reason)
        self.answer(result, refusal.reason)
        if self.is_held(result):
            self.said.words = refusal.text, self.refusing
        else:
            self.client.tell_refusal(refusal.text, self.refusing, now=now)
        reason = TaskReason(refusal.reason)
        return SubmissionRefused(
            self.rover, self.command.command, reason, refusal.text, self.actor, now
        )

    def tell(self, text: str, severity: MavSeverity, *, now: float) -> None:
        """Send a text to the client in the name of the vehicle's task server."""
        self.client.tell(text, severity, self.vehicle.server_address, now=now)


class MessageRequest(CommandRequest):
    """A mode request by the message SET_MODE, which has no acknowledgement."""

    @classmethod
    def of(
        cls, client: GcsClient, vehicle: Vehicle, packet: Packet, mode: int, *, now: float
    ) -> Self:
        """Return the request for a mode, by its number."""
        target = Address(vehicle.system_id, AUTOPILOT)
        params = (*vehicle.persona.mode_params(mode), 0.0, 0.0, 0.0, 0.0)
        command = Command(target, MavCmd.DO_SET_MODE, params, 0, None, NO_MESSAGE)
        said = client.sender.take_in(command, packet.raw, now=now)
        return cls(client, vehicle, packet, said, row_of_command(SET_MODE))

    @property
    def marks(self) -> Marks:
        """Empty keys, equal for all: a ground station repeats SET_MODE and means it once."""
        return Marks()

    def is_held(self, result: MavResult) -> bool:  # noqa: ARG002
        """Return False: there is no answer."""
        return False

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Do nothing: heartbeats show the mode."""
