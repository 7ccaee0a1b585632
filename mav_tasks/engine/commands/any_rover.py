"""Handles commands to the server's own address: tasks for any rover, and their status.

A task command to (250, 191), the address of the server, is a submission for any of its rovers. It
is parsed and recognised as a repeat before a rover is chosen, so that a copy of a command is never
a task of another rover. The answers come from that address; an accepting one names the rover, and
the texts and the status of the task come from that rover's task server.

In a fleet a gateway chooses among the rovers that it has. If none of them can drive the task, it
passes the command on to another gateway, with all copies of it.
"""

from collections.abc import Hashable
from dataclasses import replace
from functools import partial

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.elsewhere import Elsewhere
from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.clients.message_requests import MessageRequests
from mav_tasks.engine.clients.sender import Said
from mav_tasks.engine.commands.assignments import Assignments, check_any, driven_by
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.commands.goals import parse_command
from mav_tasks.engine.commands.ordering import AGAIN, has_left_before_halt
from mav_tasks.engine.commands.submissions import GIVEN_UP, NONCE, Submissions, acknowledge
from mav_tasks.engine.commands.translate import message_id_of, task_id_of
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.engine.policy import is_task_command
from mav_tasks.engine.services.commands import Answer, Command
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.kinds.commands import PARSERS
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.tasks.deduplicator import Known, reused
from mav_tasks.tasks.lifecycle import WAITING, TaskReason
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import ANY, Draft, TaskId

R = TaskReason

REMEMBERS = 10.0  # s for a command that was passed on; clients repeat one within 4 s
#: commands that mean something only for a rover that the sender knows
_OF_ONE_ROVER = (MavCmd.DO_REPOSITION, MavCmd.NAV_SET_YAW_SPEED, MavCmd.NAV_RETURN_TO_LAUNCH)
SUBMITTED = frozenset(PARSERS) - frozenset(_OF_ONE_ROVER)


class AnyRequest(CommandRequest):
    """A submission for any rover, or a question for a task; answered by the server's address."""

    def __init__(self, received: Received, said: Said, ours: Address) -> None:
        super().__init__(received.client, None, received.packet, said, received.row)
        component = said.command.target.component_id or ours.component_id
        self.answering = Address(ours.system_id, component)
        #: the system id of the rover once it is known
        self.chosen = ANY

    @property
    def refusing(self) -> Address:
        """The address that was addressed: a refusal is no rover's."""
        return self.answering

    @property
    def rover(self) -> int:
        """The rover's system id; ANY until it is chosen."""
        return self.chosen

    def choose(self, vehicle: Vehicle) -> None:
        """Note the rover that is chosen."""
        self.vehicle, self.chosen = vehicle, vehicle.system_id

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Send the COMMAND_ACK; an accepting one names the rover in result_param1."""
        rover = self.chosen if result is MavResult.ACCEPTED else ANY
        self.said.answer = Answer(
            self.command.command, result, result_param2, self.answering, rover
        )
        self.client.answer(self.said.answer, self.packet.source)


class AnyRover:
    """The receiver of commands to the server's own address."""

    def __init__(
        self,
        vehicles: VehicleSide,
        registry: TaskRegistry,
        room: PendingTasks,
        submissions: Submissions,
        assignments: Assignments,
        displays: MessageRequests,
        elsewhere: Elsewhere,
        settings: Settings,
    ) -> None:
        self._elsewhere = elsewhere
        self._passed_on: dict[Hashable, tuple[float, str]] = {}  # when, and to which gateway
        self._vehicles = vehicles
        self._registry = registry
        self._room = room
        self._submissions = submissions
        self._assignments = assignments
        self._displays = displays
        self.apply(settings)

    def __repr__(self) -> str:
        return f"AnyRover({self._assignments!r})"

    def apply(self, settings: Settings) -> None:
        self._driving = settings.driving

    def receive(self, received: Received, command: Command, *, now: float) -> None:
        """Execute or refuse a command to the server; others than these get no answer."""
        client, packet = received.client, received.packet
        is_shown = command.command == MavCmd.REQUEST_MESSAGE and task_id_of(command) > 0
        is_shown = is_shown and message_id_of(command) == m.TaskStatus.id
        if not (is_shown or command.command in SUBMITTED or is_task_command(command.command)):
            return
        if command.target.component_id not in (0, self._vehicles.our_address.component_id):
            return
        sender = client.sender
        if known := sender.same_packet(packet.raw, now=now):
            if known.answer is not None:
                client.answer(known.answer, packet.source)
            return
        said = sender.take_in(command, packet.raw, now=now)
        asked = AnyRequest(received, said, self._vehicles.our_address)
        try:
            if is_shown:
                self._displays.show_task(client, packet, task_id_of(command), now=now)
                asked.answer(MavResult.ACCEPTED)
            else:
                self._submit(asked, now=now)
        except Rejection as refusal:
            self._submissions.refuse(asked, refusal, now=now)

    def nonce_taken(self, taken: NonceTaken, *, now: float) -> None:
        """Answer with the task that the fleet had with this nonce, and undo ours."""
        task = self._registry.get(taken.task_id)
        if task is None:  # not stored in time, and withdrawn already
            return
        if task.state in WAITING:  # else it was cancelled before that
            self._room.withdraw(task, now=now)
        for asked in self._submissions.retract(task):
            if taken.payload == task.marks.payload:
                acknowledge(asked, TaskId(taken.known))
            else:
                self._registry.record(asked.refuse(reused(task.marks.nonce), now=now))

    def _submit(self, asked: AnyRequest, *, now: float) -> None:
        client, packet, command = asked.client, asked.packet, asked.command
        if command.command not in SUBMITTED:
            raise Rejection(R.BAD_PARAMETER, f"command {command.command} must name one rover")
        asked.rights.require(asked.row.role, f"send {asked.row.name}")
        if client.waited > GIVEN_UP:
            raise Rejection(R.STALE, "delayed by the server: send it again")
        wish, terms, marks = parse_command(command, packet.raw, self._driving, now=now)
        client.uses_dialect |= is_task_command(command.command) and command.params[NONCE] != 0.0
        check_any(wish)
        draft = Draft(ANY, command.command, wish, asked.submitter, terms, marks)
        asked.rights.check_content(draft)
        confirmation = command.confirmation
        deduplicator = self._submissions.deduplicator
        known = deduplicator.known(draft, confirmation=confirmation, origin=None, now=now)
        if known is not None:
            self._answer_repeat(asked, known, now=now)
            return
        copied = client.key, packet.source, draft.marks.nonce, draft.marks.payload
        if gateway := self._passed_on_to(copied, now=now):
            self._passed_on[copied] = now, gateway
            self._elsewhere.pass_to(gateway, client, packet)
            return
        again, refuse = partial(self._submit, asked), partial(self._submissions.refuse, asked)
        after, questions = draft.terms.after, self._submissions.questions
        if after and questions.hold(after, again, refuse, now=now):
            return
        self._submissions.check_open()
        try:
            choice = self._assignments.choose(wish, now=now)
        except Rejection:
            gateway = self._elsewhere.gateway_for_any(client)
            if not gateway:
                raise
            self._passed_on[copied] = now, gateway
            self._elsewhere.pass_to(gateway, client, packet)
            return
        vehicle = self._vehicles.get(choice.vehicle)
        assert vehicle is not None, "it was chosen among them"
        asked.choose(vehicle)
        if has_left_before_halt(asked, anybodys=True):
            raise Rejection(R.STALE, f"{vehicle.tasks.halts.words} came later: {AGAIN}")
        goal = driven_by(vehicle, wish)
        draft = replace(draft, vehicle=choice.vehicle, goal=goal, choice=choice.words)
        task = self._submissions.take_in(asked.rights, vehicle, draft, now=now)
        self._submissions.await_commit(asked, task, now=now)

    def _passed_on_to(self, copied: Hashable, *, now: float) -> str:
        """Return the gateway that has got an equal command just before; "": none."""
        for key in [key for key, (at, _) in self._passed_on.items() if now - at > REMEMBERS]:
            del self._passed_on[key]
        _, gateway = self._passed_on.get(copied, (now, ""))
        return gateway

    def _answer_repeat(self, asked: AnyRequest, known: Known, *, now: float) -> None:
        task = self._registry.get(known.task_id)
        vehicle = None if task is None else self._vehicles.look_at(task.vehicle)
        if vehicle is not None:
            asked.choose(vehicle)
            self._submissions.answer_repeat(asked, known, now=now)
            return
        asked.chosen = ANY if task is None else task.vehicle  # of an earlier run, not heard yet
        asked.answer(MavResult.ACCEPTED, known.task_id)
