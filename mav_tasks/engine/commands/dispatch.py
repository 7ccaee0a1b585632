"""Dispatches each client command: to the task queue, to message requests, or to the vehicle.

Every command is answered exactly once, by the component that was addressed, to the endpoint that
sent it. A command that the server does not claim is forwarded to the vehicle; its answer comes back
through ``deliver``.
"""

from dataclasses import dataclass
from functools import partial

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.clients.message_requests import MessageRequests
from mav_tasks.engine.clients.rights import OPERATOR, SUBMITTER
from mav_tasks.engine.commands.any_rover import AnyRover
from mav_tasks.engine.commands.command_request import CommandRequest, halts_again
from mav_tasks.engine.commands.forwarding import check_relay, relay
from mav_tasks.engine.commands.mode_requests import ModeRequests
from mav_tasks.engine.commands.ordering import has_left_before_halt, note_halt, require_newer
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.commands.task_control import TaskControl
from mav_tasks.engine.commands.translate import message_id_of, result_of
from mav_tasks.engine.missions.plans import Plans
from mav_tasks.engine.policy import Kind, is_task_command
from mav_tasks.engine.services.commands import COPIED, Answer, Command
from mav_tasks.engine.timers import leave_it
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.kinds.commands import PARSERS
from mav_tasks.kinds.params import bad, has_place, whole
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, BROADCAST, Address
from mav_tasks.mavlink.enums import MavCmd, MavComponent, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import TaskId

R = TaskReason

NOT_CHANGED = "not stored in time: nothing changed"
MODE_TRIED_AGAIN = 2.0  # s; QGroundControl asks again after 1.3 s


@dataclass(repr=False, eq=False)
class Commands:
    """The dispatcher of client commands."""

    _vehicles: VehicleSide
    _submissions: Submissions
    _plans: Plans
    _modes: ModeRequests
    _control: TaskControl
    _displays: MessageRequests
    _any: AnyRover

    def receive(self, received: Received, command: Command, *, now: float) -> None:
        """Execute or refuse a client's command, and answer it."""
        client, packet = received.client, received.packet
        if command.command == MavCmd.TASK_STOP:
            self._stop(client, packet, command, now=now)
            return
        system_id = command.target.system_id
        if system_id == self._vehicles.our_address.system_id:  # and no rover
            self._any.receive(received, command, now=now)
            return
        vehicle = self._vehicles.get(system_id or min(self._vehicles.by_id, default=0))
        if vehicle is None:
            self._of_unheard(client, packet, command, now=now)
            return
        sender = client.sender
        known = sender.same_packet(packet.raw, now=now)
        if known is not None and not halts_again(command, vehicle, after=now - known.at):
            if known.answer is not None and not known.is_held:
                client.answer(known.answer, packet.source)
            return
        said = sender.take_in(command, packet.raw, now=now)
        asked = CommandRequest(client, vehicle, packet, said, received.row)
        epoch = vehicle.tasks.halts.epoch
        try:
            if asked.kind is Kind.GO:
                require_newer(asked, now=now)
            self._dispatch(asked, now=now)
        except Rejection as refusal:
            if self._is_tried_again(asked, now=now):
                asked.answer(MavResult.CANCELLED, refusal.reason)
            else:
                self._submissions.refuse(asked, refusal, now=now)
        if asked.kind is Kind.HALT or vehicle.tasks.halts.epoch != epoch:
            note_halt(asked, before=epoch)
        if asked.kind is Kind.HALT and asked.said.answer is not None:  # else the rover answers
            self._submissions.answer_halt(client, asked.said, packet.source, now=now)

    def _of_unheard(
        self, client: GcsClient, packet: Packet, command: Command, *, now: float
    ) -> None:
        """Answer a command for a rover that was not heard in this run.

        REQUEST_MESSAGE is answered. Task commands and DO_PAUSE_CONTINUE are refused, but not in the
        first seconds: the rover may be heard while a script still repeats its command. Without a
        rover the server answers requests for TASK_QUEUE_STATUS to system 0. All others get no
        answer: clients send to everyone.
        """
        system_id, component = command.target
        tasks = next((each for each in self._vehicles.unheard if each.vehicle == system_id), None)
        address = Address(system_id, MavComponent.ONBOARD_COMPUTER)
        result, reason, words = MavResult.ACCEPTED, int(R.NONE), ""
        if tasks is None:
            is_question = command.command == MavCmd.REQUEST_MESSAGE
            is_for_servers = is_question and message_id_of(command) == m.TaskQueueStatus.id
            if system_id != BROADCAST or not is_for_servers:
                return
            address = self._vehicles.our_address
        elif command.command == MavCmd.REQUEST_MESSAGE:
            try:
                if not self._displays.show_unheard(
                    client, packet, command, tasks, address, now=now
                ):
                    return
            except Rejection as refusal:
                result, reason, words = result_of(refusal.reason), refusal.reason, refusal.text
        elif self._vehicles.has_listened(now=now) and (
            is_task_command(command.command) or command.command == MavCmd.DO_PAUSE_CONTINUE
        ):
            result, reason = result_of(R.VEHICLE_SILENT), int(R.VEHICLE_SILENT)
            words = f"only STOP works: {self._vehicles.why_unheard(system_id, now=now)}"
        else:
            return
        source = Address(system_id, component) if tasks is not None and component else address
        client.answer(Answer(command.command, result, reason, source), packet.source)
        if words and client.may_be_refused(now=now):
            client.tell_refusal(words, address, now=now)

    def _is_tried_again(self, asked: CommandRequest, *, now: float) -> bool:
        """Whether an equal mode request was refused a moment ago.

        QGroundControl asks three times, and shows a dialog for each refusal; none for CANCELLED.
        """
        is_mode = asked.command.command == MavCmd.DO_SET_MODE
        return is_mode and any(
            each.is_refused for each in asked.earlier(within=MODE_TRIED_AGAIN, now=now)
        )

    def _dispatch(self, asked: CommandRequest, *, now: float) -> None:
        if asked.command.target.system_id == BROADCAST:  # others: see ``Broadcasts``
            number = asked.command.command
            raise Rejection(R.BAD_PARAMETER, f"command {number} must name one rover, not system 0")
        row, component = asked.row, asked.command.target.component_id
        at_server = component == asked.vehicle.server_address.component_id
        if row.is_claimed and (
            at_server or component in (0, AUTOPILOT) or _is_of_what_nobody_sends(asked)
        ):
            asked.rights.require(row.role, f"send {row.name}")
            if self._handle(asked, at_server=at_server, now=now):
                return
        if at_server and row.kind is Kind.QUESTION:  # ground stations ask all components
            asked.answer(MavResult.UNSUPPORTED, R.NOT_SUPPORTED_BY_VEHICLE)
        elif at_server:
            self._refuse_unknown(asked, now=now)
        elif asked.command.command == MavCmd.DO_SET_MODE and self._modes.asked(asked, now=now):
            return
        else:  # also for a component never heard: an autopilot executes its commands
            lets_go = row.kind is not Kind.GO and not row.passed_on.passes_under_stop
            if lets_go and not asked.vehicle.tasks.is_stopped:
                require_newer(asked, now=now)
            check_relay(asked, row.passed_on, now=now)
            self._check_question(asked, now=now)
            relay(asked, now=now)

    def _handle(self, asked: CommandRequest, *, at_server: bool, now: float) -> bool:
        """Execute a command that the server claims. Return False if the rover is to answer it."""
        vehicle = asked.vehicle
        # the settings may leave standard commands that are sent to the autopilot to it
        claims = at_server or vehicle.parts.settings.claim
        match asked.command.command:
            case MavCmd.DO_REPOSITION if claims:
                self._reposition(asked, now=now)
            case number if number in PARSERS and (claims or is_task_command(number)):
                self._submissions.submit(asked, now=now)
            case MavCmd.TASK_CANCEL | MavCmd.TASK_CLEAR | MavCmd.TASK_RELEASE:
                asked.answer(MavResult.ACCEPTED, self._control.act(asked, now=now))
            case MavCmd.TASK_MODIFY | MavCmd.DO_CHANGE_SPEED:
                task_id, undo = self._control.change(asked, now=now)
                self._submissions.answer_once_durable(
                    asked, task_id, NOT_CHANGED, undo=undo, now=now
                )
            case MavCmd.NAV_TAKEOFF if claims:  # examples for every kind of vehicle send it
                asked.answer(MavResult.ACCEPTED)
            case MavCmd.NAV_LAND if claims:
                vehicle.joint.stand_down(asked.client.key, now=now)
                asked.answer(MavResult.ACCEPTED)
            case MavCmd.MISSION_START if claims:
                first = whole(asked.command, 1, "first item", high=0xFFFF)
                last = whole(asked.command, 2, "last item", high=0xFFFF)
                if last:
                    raise bad(f"param2 last item {last}: only the whole plan can run", param=2)
                self._modes.start_plan(asked, first=first, now=now)
            case MavCmd.DO_SET_MISSION_CURRENT if claims:
                self._plans.check_start(asked.rights, vehicle, asked.submitter)
                seq = whole(asked.command, 1, "item", high=0xFFFF, default=None)
                undo = self._plans.undo_of_jump(vehicle)
                task, then = self._plans.go_on_with(vehicle, seq, now=now), leave_it
                if task is None:
                    begins = self._plans.begins_with(vehicle, seq)
                    then = partial(asked.tell, begins, MavSeverity.INFO)
                self._submissions.answer_once_durable(
                    asked,
                    TaskId(task.id if task else 0),
                    NOT_CHANGED,
                    undo=undo,
                    then=then,
                    now=now,
                )
            case MavCmd.DO_PAUSE_CONTINUE:
                asked.answer(MavResult.ACCEPTED, self._pause_continue(asked, now=now) or 0)
            case MavCmd.SET_MESSAGE_INTERVAL:
                self._displays.set_interval(asked, now=now)
                asked.answer(MavResult.ACCEPTED)
            case MavCmd.GET_MESSAGE_INTERVAL:
                self._displays.show_interval(asked)
                asked.answer(MavResult.ACCEPTED)
            case MavCmd.REQUEST_MESSAGE if self._displays.show(asked, now=now):
                asked.answer(MavResult.ACCEPTED)
            case number if is_task_command(number):
                self._refuse_unknown(asked, now=now)
            case _:
                return False
        return True

    def _check_question(self, asked: CommandRequest, *, now: float) -> None:
        """Raise Rejection if an observer's question is too much for the rover's link."""
        if asked.row.kind is Kind.QUESTION and not asked.rights.reach(SUBMITTER):
            message = asked.command.message
            why_not = self._vehicles.why_not_asked(
                asked.vehicle, asked.client.key, asked.packet, message, now=now
            )
            if why_not is not None:
                raise asked.rights.refusal(why_not, R.RATE_LIMITED)

    def _refuse_unknown(self, asked: CommandRequest, *, now: float) -> None:
        words = f"command {asked.command.command}: not supported in this version"
        refusal = Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
        self._submissions.refuse(asked, refusal, result=MavResult.UNSUPPORTED, now=now)

    def _reposition(self, asked: CommandRequest, *, now: float) -> None:
        """DO_REPOSITION: submit a "go to"; without a place, pause."""
        if not has_place(asked.command):
            asked.answer(MavResult.ACCEPTED, self._pause(asked, now=now) or 0)
            return
        parts = asked.vehicle.parts
        held = parts.hold_before.holder(now=now)
        # a "go to" from before the HOLD, or a copy of one, does not undo it
        is_older = has_left_before_halt(asked)
        is_older |= held is not None and any(
            each.at < held.since and not each.is_refused
            for each in asked.earlier(within=COPIED, now=now)
        )
        self._submissions.submit(asked, now=now)
        # MAVSDK, and no person, has sent the HOLD just before
        if held is None or held.sender != asked.sender or is_older:
            return
        if held is parts.hold_before.holder(now=now):
            parts.forget_go_to()
            if held.has_paused and asked.rights.reach(OPERATOR):
                parts.undone.give(held)
                undo = partial(asked.vehicle.joint.go_to_follows, held, actor=asked.actor)
                self._submissions.gate.hold(undo, leave_it, now=now)  # not stored: the HOLD stays

    # STOP, pause, modes

    def _stop(self, client: GcsClient, packet: Packet, command: Command, *, now: float) -> None:
        """Stop one vehicle or all, whatever the target component; execute every copy.

        DEVIATION: for target_system 0, or the server's own, there is one ack, not one from each
        system: the worst result, from the task server of the lowest system id.
        """
        target = command.target
        if target.system_id == self._vehicles.our_address.system_id:  # the server's: all
            target = Address(BROADCAST, target.component_id)
        targets = self._vehicles.addressed_by(target.system_id)
        actor = str(client.submitter(packet.source))
        is_to_clear = command.params[0] == 1.0
        clear = is_to_clear and client.rights.reach(OPERATOR)  # STOP needs no role
        unheard = self._vehicles.stop_unheard(target.system_id, clear=clear, actor=actor, now=now)
        if not targets and not unheard:
            return
        killed = [vehicle.joint.stop(clear=clear, actor=actor, now=now) for vehicle in targets]
        sender = client.sender
        for vehicle in targets:
            vehicle.tasks.halts.was_said_by(sender, sender.line.number_of(packet.seq))
        silent = [vehicle.system_id for vehicle in targets if not vehicle.is_heard(now=now)]
        silent += unheard
        component = targets[0].server_component if targets else MavComponent.ONBOARD_COMPUTER
        source = Address(
            target.system_id or min([*unheard, *(vehicle.system_id for vehicle in targets)]),
            (target.component_id if target.system_id else 0) or component,
        )
        if silent:
            result, param2 = MavResult.FAILED, int(R.VEHICLE_SILENT)
            rovers = "rover" if len(silent) == 1 else "rovers"
            words = f"STOP in force, but {rovers} {', '.join(map(str, silent))} silent"
            client.tell(words, MavSeverity.ERROR, source, now=now)
        else:
            result, param2 = MavResult.ACCEPTED, next((k for k in killed if k), 0)
        if is_to_clear and not clear and client.may_be_refused(now=now):
            words = f"stopped, but role {client.rights.role} may not clear a queue; {OPERATOR} may"
            client.tell(words, MavSeverity.WARNING, source, now=now)
        said = sender.take_in(command, packet.raw, now=now)
        said.answer = Answer(command.command, result, param2, source)
        self._submissions.answer_halt(client, said, packet.source, now=now)

    def _pause_continue(self, asked: CommandRequest, *, now: float) -> int | None:
        vehicle = asked.vehicle
        match asked.command.params[0]:
            case 0.0:
                return self._pause(asked, now=now)
            case 1.0:
                return vehicle.joint.proceed(actor=asked.actor, now=now)
            case value:
                raise Rejection(R.BAD_PARAMETER, f"param1 {value:g}: 0 pauses, 1 continues")

    def _pause(self, asked: CommandRequest, *, now: float) -> TaskId | None:
        vehicle = asked.vehicle
        self._submissions.held(vehicle, asked.submitter)
        paused = vehicle.joint.pause(actor=asked.actor, now=now)
        if not vehicle.is_heard(now=now):  # it is paused nevertheless
            raise Rejection(R.VEHICLE_SILENT, f"paused, but rover {vehicle.system_id} is silent")
        return paused


def _is_of_what_nobody_sends(asked: CommandRequest) -> bool:
    """Whether a message interval is set or requested of a component that was never heard.

    The autopilot would answer in its place, about the autopilot's own messages too.
    """
    intervals = MavCmd.SET_MESSAGE_INTERVAL, MavCmd.GET_MESSAGE_INTERVAL
    component = asked.command.target.component_id
    return asked.command.command in intervals and component not in asked.vehicle.components
