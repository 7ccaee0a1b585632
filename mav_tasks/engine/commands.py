"""What each command of a client does: to the queue, to a vehicle, or to what the client is shown.

Every command is answered exactly once, from the component that was addressed, to the endpoint that
asked. What is not ours is forwarded to the vehicle, whose answer comes back through ``deliver``.
"""

from functools import partial
from typing import NamedTuple

from mav_tasks.engine import translate
from mav_tasks.engine.commit_gate import CommitGate
from mav_tasks.engine.gcs_client import GcsClient
from mav_tasks.engine.gcs_side import GcsSide
from mav_tasks.engine.inputs import Peer
from mav_tasks.engine.vehicle import Vehicle
from mav_tasks.engine.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import (
    Answer,
    Command,
    NonceReused,
    Pending,
    Repeat,
)
from mav_tasks.services.command_sender import Answered
from mav_tasks.settings import Settings
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Task

R = TaskReason

#: command ids set aside for tasks
OUR_COMMANDS = range(54000, 54050)
#: commands that move a vehicle or let it be moved: none passes while STOP is latched
MOVING = frozenset(
    {
        MavCmd.NAV_WAYPOINT,
        17,  # NAV_LOITER_UNLIM
        18,  # NAV_LOITER_TURNS
        19,  # NAV_LOITER_TIME
        MavCmd.NAV_RETURN_TO_LAUNCH,
        MavCmd.NAV_LAND,
        MavCmd.NAV_TAKEOFF,
        34,  # DO_ORBIT
        115,  # CONDITION_YAW
        MavCmd.DO_REPOSITION,
        213,  # NAV_SET_YAW_SPEED
        MavCmd.DO_MOTOR_TEST,
        MavCmd.MISSION_START,
    }
)
#: of these, those that a vehicle follows in the mode in which we drive it: a second source
SAME_MODE = MOVING - {MavCmd.NAV_RETURN_TO_LAUNCH, MavCmd.NAV_LAND, MavCmd.MISSION_START}

PROTOCOL_VERSION = m.ProtocolVersion(200, 100, 200, [0] * 8, [0] * 8)
PAGE = 16  # waiting tasks that one request shows


class _Asker(NamedTuple):
    """Whose command was forwarded: the endpoint, and the MAVLink address there."""

    client: tuple[str, Peer]
    source: Address


class Commands:
    """The answers to commands, and their effects."""

    def __init__(
        self, gcs: GcsSide, vehicles: VehicleSide, book: TaskBook, settings: Settings
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._book = book
        self._settings = settings
        self._gate = CommitGate()
        self._store_is_away = False
        self._is_closing = False

    def close(self) -> None:
        """Take no more submissions: the server ends."""
        self._is_closing = True

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings

    # durability

    def committed(self, through: int) -> None:
        """Let go what waited for the store."""
        self._store_is_away = False
        self._gate.committed(through)

    def store_failed(self) -> None:
        """Refuse new submissions until something has been committed again."""
        self._store_is_away = True

    def next_deadline(self) -> float | None:
        """Give when a submission has waited too long for the store."""
        return self._gate.next_deadline()

    def handle_deadline(self, *, now: float) -> None:
        """Withdraw submissions that did not become durable in time."""
        self._gate.handle_deadline(now=now)

    # commands

    def receive(self, client: GcsClient, packet: Packet, command: Command, *, now: float) -> None:
        """See to a client's command."""
        if command.command == MavCmd.TASK_STOP:
            self._stop(client, packet, command, now=now)
            return
        vehicle = self._vehicles.vehicles.get(command.target.system_id)
        if vehicle is None:
            return  # clients send everything to everyone: it is for somebody else
        if command.target.component_id not in (0, AUTOPILOT, vehicle.server_component):
            self._relay(client, vehicle, packet, command, now=now)
            return
        receiver = client.receiver(packet.source)
        known = receiver.same_packet(packet.raw, now=now)
        if known is not None:
            if known.answer is not None:
                self._send(client, packet.source, known.answer)
            return
        pending = receiver.remember(command, packet.raw, now=now)
        try:
            self._dispatch(client, vehicle, packet, pending, now=now)
        except Rejection as refusal:
            self._refuse(client, vehicle, packet, pending, refusal, now=now)

    def _dispatch(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        pending: Pending,
        *,
        now: float,
    ) -> None:
        command = pending.command
        answer = partial(self._answer, client, vehicle, packet.source, pending)
        actor = str(client.submitter(packet.source))
        at_autopilot = command.target.component_id != vehicle.server_component
        match command.command:
            case MavCmd.TASK_MOVE | MavCmd.TASK_ROTATE:
                self._submit(client, vehicle, packet, pending, now=now)
            case MavCmd.DO_PAUSE_CONTINUE:
                answer(MavResult.ACCEPTED, self._pause_continue(vehicle, command, actor, now=now))
            case MavCmd.SET_MESSAGE_INTERVAL:
                answer(self._set_interval(client, vehicle, command, now=now))
            case MavCmd.GET_MESSAGE_INTERVAL:
                message_id = translate.message_id_of(command)
                interval = client.thinner.interval_us(vehicle.system_id, max(0, message_id))
                client.outlet.send(
                    m.MessageInterval(max(0, message_id), interval),
                    _answering(vehicle, command),
                )
                answer(MavResult.ACCEPTED)
            case MavCmd.REQUEST_MESSAGE if self._show(client, vehicle, command, now=now):
                answer(MavResult.ACCEPTED)
            case MavCmd.DO_SET_MODE if at_autopilot:
                self._set_mode(client, vehicle, packet, pending, now=now)
            case number if number in OUR_COMMANDS:
                raise Rejection(
                    R.NOT_SUPPORTED_BY_VEHICLE, f"command {number}: not supported in this version"
                )
            case _ if at_autopilot:
                self._check_relay(client, vehicle, command, now=now)
                self._relay(client, vehicle, packet, command, now=now)
            case _:
                answer(MavResult.UNSUPPORTED)

    def deliver(self, vehicle: Vehicle, answered: Answered, *, now: float) -> None:
        """Bring a vehicle's answer, or its silence, to the client that asked."""
        asker = answered.origin
        assert isinstance(asker, _Asker), "only _relay gives commands an origin"
        client = self._gcs.client(asker.client)
        if client is None:
            return
        ack = answered.ack
        addressed = Address(vehicle.system_id, answered.component)
        if ack is not None:
            answer = Answer(ack.command, ack.result, ack.result_param2, addressed)
        elif answered.command == MavCmd.REQUEST_MESSAGE:
            answer = Answer(answered.command, MavResult.UNSUPPORTED, 0, addressed)
        else:
            answer = Answer(answered.command, MavResult.TEMPORARILY_REJECTED, 0, addressed)
            words = f"command {answered.command}: no answer from vehicle {vehicle.system_id}"
            client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)
        self._send(client, asker.source, answer)

    def set_mode(
        self, client: GcsClient, packet: Packet, message: m.SetMode, *, now: float
    ) -> None:
        """See to the message SET_MODE, which nothing acknowledges."""
        vehicle = self._vehicles.vehicles.get(message.target_system)
        if vehicle is None:
            return
        actor = str(client.submitter(packet.source))
        mode = int(message.custom_mode)
        if mode == vehicle.persona.hold_mode:
            vehicle.hold(actor=actor, now=now)
        elif vehicle.tasks.is_stopped:
            self._tell_stopped(client, vehicle, now=now)
        else:
            vehicle.client_asks_mode(mode, client.key, now=now)
            vehicle.forward(packet)

    # STOP, pause, modes

    def _stop(self, client: GcsClient, packet: Packet, command: Command, *, now: float) -> None:
        """Stop one vehicle or all; acts on every copy, and answers it.

        DEVIATION: for target_system 0 there is one ack, not one from each system: the worst
        result, from the task server of the lowest system id.
        """
        targets = [
            vehicle
            for system_id, vehicle in sorted(self._vehicles.vehicles.items())
            if command.target.system_id in (0, system_id)
            and command.target.component_id in (0, AUTOPILOT, vehicle.server_component)
        ]
        if not targets:
            return
        actor = str(client.submitter(packet.source))
        clear = command.params[0] == 1.0
        killed = [vehicle.stop(clear=clear, actor=actor, now=now) for vehicle in targets]
        client.uses_dialect = True
        silent = [vehicle for vehicle in targets if not vehicle.is_heard(now=now)]
        source = (
            targets[0].server_address
            if command.target.system_id == 0
            else _answering(targets[0], command)
        )
        if silent:
            result, param2 = MavResult.FAILED, int(R.VEHICLE_SILENT)
            words = ", ".join(str(vehicle.system_id) for vehicle in silent)
            client.tell(f"STOP kept: vehicle {words} silent", MavSeverity.ERROR, source, now=now)
        else:
            result, param2 = MavResult.ACCEPTED, next((k for k in killed if k), 0)
        self._send(client, packet.source, Answer(command.command, result, param2, source))

    def _pause_continue(self, vehicle: Vehicle, command: Command, actor: str, *, now: float) -> int:
        match command.params[0]:
            case 0.0:
                return vehicle.pause(actor=actor, now=now) or 0
            case 1.0:
                return vehicle.proceed(actor=actor, now=now) or 0
            case value:
                raise Rejection(R.BAD_PARAMETER, f"param1 {value:g}: 0 pauses, 1 continues")

    def _set_mode(
        self, client: GcsClient, vehicle: Vehicle, packet: Packet, pending: Pending, *, now: float
    ) -> None:
        value = pending.command.params[1]
        if not (0 <= value <= 0xFFFFFFFF and value == int(value)):
            raise Rejection(R.BAD_PARAMETER, f"param2 mode {value:g} is no mode number")
        mode = int(value)
        if mode == vehicle.persona.hold_mode:
            if not vehicle.is_heard(now=now):
                vehicle.hold(actor=str(client.submitter(packet.source)), now=now)
                raise Rejection(R.VEHICLE_SILENT, f"vehicle {vehicle.system_id} is silent")
            paused = vehicle.hold(actor=str(client.submitter(packet.source)), now=now)
            self._answer(client, vehicle, packet.source, pending, MavResult.ACCEPTED, paused or 0)
            return
        if vehicle.tasks.is_stopped:
            raise Rejection(R.STOPPED, "STOP is latched: continue first")
        vehicle.client_asks_mode(mode, client.key, now=now)
        self._relay(client, vehicle, packet, pending.command, now=now)

    # submissions

    def _submit(
        self, client: GcsClient, vehicle: Vehicle, packet: Packet, pending: Pending, *, now: float
    ) -> None:
        command = pending.command
        client.uses_dialect = True
        nonce = translate.nonce_of(command)
        receiver = client.receiver(packet.source)
        try:
            repeat = receiver.same_submission(command, nonce=nonce, now=now)
        except NonceReused:
            raise Rejection(R.NONCE_REUSED, f"nonce {nonce} was used for something else") from None
        if repeat is not None:
            self._answer_repeat(client, vehicle, packet, pending, repeat, now=now)
            return
        if self._is_closing:
            raise Rejection(R.RATE_LIMITED, "the server is shutting down")
        if self._store_is_away:
            raise Rejection(R.STORE_UNAVAILABLE, "the store is away: not accepted")
        draft = translate.draft_of(
            command, vehicle.system_id, client.submitter(packet.source), self._settings.driving
        )
        task = vehicle.tasks.submit(draft, now=now)
        receiver.remember_submission(pending, nonce=nonce)
        give_up_at = now + self._settings.watch.commit
        self._gate.hold(
            self._book.recorded,
            give_up_at=give_up_at,
            release=partial(self._accept, client, vehicle, packet.source, pending, task, now=now),
            give_up=partial(self._withdraw, client, vehicle, packet, pending, task, now=give_up_at),
        )

    def _accept(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        source: Address,
        pending: Pending,
        task: Task,
        *,
        now: float,
    ) -> None:
        """The submission is durable: acknowledge it with the task's id, and tell of it."""
        self._answer(client, vehicle, source, pending, MavResult.ACCEPTED, task.id)
        client.statuses.changed(task.id)
        words = f"Task {task.id} queued: {translate.describe(task.goal)}"
        self._gcs.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

    def _withdraw(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        pending: Pending,
        task: Task,
        *,
        now: float,
    ) -> None:
        client.receiver(packet.source).forget_submission(pending, nonce=task.nonce)
        self._store_is_away = True
        current = self._book.get(task.id)
        if current is not None and vehicle.tasks.position(current) is not None:
            vehicle.tasks.withdraw(current, now=now)
        refusal = Rejection(R.STORE_UNAVAILABLE, "not stored in time: not accepted")
        self._refuse(client, vehicle, packet, pending, refusal, now=now)

    def _answer_repeat(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        pending: Pending,
        repeat: Repeat,
        *,
        now: float,
    ) -> None:
        """The same submission again: the same answer, or none yet if it has none yet."""
        answer = repeat.first.answer
        if answer is None:
            return
        self._answer(
            client, vehicle, packet.source, pending, MavResult(answer.result), answer.result_param2
        )
        if repeat.same_payload:
            words = f"same command again: still task {answer.result_param2}"
            client.tell(words, MavSeverity.INFO, vehicle.server_address, now=now)

    # what a client is shown

    def _set_interval(
        self, client: GcsClient, vehicle: Vehicle, command: Command, *, now: float
    ) -> MavResult:
        message_id, interval_us = translate.message_id_of(command), command.params[1]
        if message_id < 0 or interval_us != interval_us or interval_us == float("inf"):
            raise Rejection(R.BAD_PARAMETER, "param1 message id or param2 interval is not a number")
        if message_id == m.TaskStatus.id:
            client.uses_dialect = True
            client.statuses.set_interval(interval_us / 1e6 if interval_us > 0 else None, now=now)
            return MavResult.ACCEPTED
        client.thinner.set_interval(vehicle.system_id, message_id, interval_us)
        for wished_id, interval in client.thinner.wishes(vehicle.system_id).items():
            vehicle.intervals.wish(wished_id, interval)
        return MavResult.ACCEPTED

    def _show(self, client: GcsClient, vehicle: Vehicle, command: Command, *, now: float) -> bool:
        """Answer REQUEST_MESSAGE for what the server itself can show; whether it can."""
        source = _answering(vehicle, command)
        match translate.message_id_of(command):
            case m.TaskStatus.id:
                client.uses_dialect = True
                self._show_tasks(client, vehicle, command, now=now)
            case m.TaskQueueStatus.id:
                client.uses_dialect = True
                counts = [0] * 14
                for task in self._book.of_vehicle(vehicle.system_id):
                    counts[task.state] += 1
                status = translate.queue_status(
                    vehicle.tasks, counts, version=self._book.recorded, now=now
                )
                client.outlet.send(status, source)
            case m.ProtocolVersion.id:
                client.outlet.send(PROTOCOL_VERSION, source)
            case _:
                return False
        return True

    def _show_tasks(
        self, client: GcsClient, vehicle: Vehicle, command: Command, *, now: float
    ) -> None:
        task_id = translate.task_id_of(command)
        if task_id == 0:
            first = max(0, round(command.params[2])) if command.params[2] < 1e7 else 0
            for waiting in vehicle.tasks.waiting[first : first + PAGE]:
                self.send_status(client, waiting, with_position=True, now=now)
        elif self._book.get(task_id) is None:
            raise Rejection(R.NOT_FOUND, f"no task {command.params[1]:g}")
        else:
            self.send_status(client, task_id, with_position=True, now=now)

    def send_status(
        self, client: GcsClient, task_id: int, *, with_position: bool, now: float
    ) -> None:
        """Send a task's TASK_STATUS to a client, from the task server of its vehicle."""
        task = self._book.get(task_id)
        vehicle = None if task is None else self._vehicles.vehicles.get(task.vehicle)
        if task is None or vehicle is None:
            return
        status = translate.task_status(
            task, vehicle.tasks, link_number=0, with_position=with_position, now=now
        )
        client.outlet.send(status, vehicle.server_address)

    # forwarding and answering

    def _check_relay(
        self, client: GcsClient, vehicle: Vehicle, command: Command, *, now: float
    ) -> None:
        """Refuse what would move a stopped vehicle, or drive one that a task drives."""
        arms = command.command == MavCmd.COMPONENT_ARM_DISARM and command.params[0] != 0.0
        if vehicle.tasks.is_stopped and (arms or command.command in MOVING):
            raise Rejection(R.STOPPED, "STOP is latched: continue first")
        if command.command in SAME_MODE and not vehicle.may_move(client.key, now=now):
            raise Rejection(R.NOT_ALLOWED, f"command {command.command}: not while tasks drive")

    def _relay(
        self, client: GcsClient, vehicle: Vehicle, packet: Packet, command: Command, *, now: float
    ) -> None:
        asker = _Asker(client.key, packet.source)
        vehicle.relay(packet, command.message, asker, command=command.command, now=now)

    def _answer(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        source: Address,
        pending: Pending,
        result: MavResult,
        result_param2: int = 0,
    ) -> None:
        command = pending.command
        pending.answer = Answer(
            command.command, result, result_param2, _answering(vehicle, command)
        )
        self._send(client, source, pending.answer)

    def _send(self, client: GcsClient, to: Address, answer: Answer) -> None:
        client.outlet.send(answer.ack(to), answer.source)

    def _refuse(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        pending: Pending,
        refusal: Rejection,
        *,
        now: float,
    ) -> None:
        """Answer with the reason's code, say it in words, and keep it for the audit log."""
        command = pending.command.command
        result = translate.result_of(refusal.reason)
        self._answer(client, vehicle, packet.source, pending, result, refusal.reason)
        client.tell(refusal.text, MavSeverity.WARNING, vehicle.server_address, now=now)
        actor = str(client.submitter(packet.source))
        self._book.record(
            SubmissionRefused(
                vehicle.system_id, command, R(refusal.reason), refusal.text, actor, now
            )
        )

    def _tell_stopped(self, client: GcsClient, vehicle: Vehicle, *, now: float) -> None:
        words = "STOP is latched: continue first"
        client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)


def _answering(vehicle: Vehicle, command: Command) -> Address:
    """Give the address that a command's answer comes from: the one addressed; of all, our own."""
    return Address(vehicle.system_id, command.target.component_id or vehicle.server_component)
