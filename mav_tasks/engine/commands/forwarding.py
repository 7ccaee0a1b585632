"""Forwards what clients send to vehicles and the server does not claim; drops what may not pass.

A client that streams setpoints must not drive the instant a task ends. While a task drives a
vehicle, only manual control moves it. A packet goes to the link on which its target was seen; the
answer to a command comes back through ``deliver``.
"""

from collections.abc import Hashable, Iterable
from math import inf, isfinite
from typing import Any, NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import ROLES
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide, Received
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import SAFETY
from mav_tasks.engine.clients.sender import Said
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.commands.translate import IN_FORCE
from mav_tasks.engine.inputs import Peer, Place
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.services import file_transfer
from mav_tasks.engine.services.commands import Answer, Answered, Standing
from mav_tasks.engine.services.orders import Phase, moves
from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.joint_control import Word
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.kinds.goto import CHANGE_MODE, reposition_flags
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, EVERYBODY, Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.messages import CommandInt, CommandLong, Message
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.lifecycle import CONTINUE_FIRST, STOP_IN_FORCE, TaskReason

NO_PLACE = 7  # type_mask that ignores x, y and z
STICKS_CENTRED = 50  # of ±1000 (MANUAL_CONTROL) or µs around 1500 (RC override)
NO_STICK = 0x7FFF
RC_CENTRE = 1500
RC_IGNORED = (0, 65535)
#: the one reason why the setpoints of a client do not pass that may drive
UNARMED = "the rover is not armed"


def why_not_moved(parts: Parts, client: Hashable, *, takes_over: bool = False) -> str:
    """Return why a client's motion message may not pass, in words, or "" if it may.

    ``takes_over``: the client also asks for the mode in which clients drive.
    """
    why_not = why_no_motion(parts, takes_over=takes_over)
    if why_not:
        return why_not
    if parts.tasks.is_driving:  # also one that is paused
        return "not during a task"
    if not takes_over and not parts.authority.has_granted(client):
        return f"set {parts.persona.mode_name(parts.persona.control_mode)} first"
    return "" if parts.monitor.armed else UNARMED


def why_no_motion(parts: Parts, *, takes_over: bool = False) -> str:
    """Return why no client may move it now, in words, or "" if one may.

    With ``takes_over``, the client may continue from where we hand the vehicle back.
    """
    if parts.tasks.is_stopped:
        return STOP_IN_FORCE
    if parts.control.is_engaged and not (takes_over and parts.control.phase is Phase.RELEASING):
        return "not during a task"
    if parts.control.awaits_mode:
        return "the server is setting HOLD"
    return ""


def why_not_sent(row: Row, vehicle: Vehicle, client: Hashable, *, takes_over: bool = False) -> str:
    """Return why a client's message may not go to a rover now, "" if it may.

    ``takes_over``: it also asks for the mode in which clients drive.
    """
    if row.needs_grant:
        return why_not_moved(vehicle.parts, client, takes_over=takes_over)
    if not row.passes_beside_task:
        return why_no_motion(vehicle.parts, takes_over=takes_over)
    if not row.passes_under_stop and vehicle.tasks.is_stopped:
        return STOP_IN_FORCE
    return ""


def may_pass(
    vehicle: Vehicle,
    client: GcsClient,
    row: Row,
    message: m.Message | None,
) -> bool:
    """Whether a client's packet may be forwarded to the vehicle; if so, call ``passed``."""
    # it may have waited here while the vehicle stopped by itself
    if client.is_late and row.kind in (Kind.MOTION, Kind.STICKS) and not _asks_to_stand(message):
        return False
    if row.needs_grant and message is not None and not _is_finite(message):
        return False
    return not why_not_sent(row, vehicle, client.key)


def passed(
    vehicle: Vehicle, client: GcsClient, row: Row, message: m.Message | None, *, now: float
) -> None:
    """Note the effect on the tasks of a packet that is forwarded to the vehicle."""
    if row.needs_grant:
        vehicle.parts.authority.note_client(client.key, now=now)
    elif isinstance(message, m.ManualControl):
        if _has_moved(message, client, vehicle.persona.centred_throttles):
            vehicle.joint.sticks_moved(actor=str(client.who), now=now)
    elif isinstance(message, m.RcChannelsOverride):
        channels = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
        off_centre = (abs(c - RC_CENTRE) for c in channels if c not in RC_IGNORED)
        if any(each > STICKS_CENTRED for each in off_centre):
            vehicle.joint.sticks_moved(actor=str(client.who), now=now)


def _asks_to_stand(message: m.Message | None) -> bool:
    return (
        isinstance(message, m.SetPositionTargetLocalNed)
        and message.type_mask & NO_PLACE == NO_PLACE
        and not moves(message)
        and not any((message.afx, message.afy, message.afz))
    )


def _is_finite(message: m.Message) -> bool:
    """Whether all numbers are finite: others make autopilots abort, even in ignored fields."""
    values: Iterable[Any] = message.to_dict().values()  # arrays, too, which pymavlink does not say
    return all(
        isfinite(number)
        for value in values
        for number in (value if isinstance(value, list) else [value])
        if isinstance(number, float)
    )


def _has_moved(message: m.ManualControl, client: GcsClient, throttles: Iterable[int]) -> bool:
    """Whether a stick is off its centre, or the throttle has jumped from one centre to another."""
    sticks, has_jumped = [message.x, message.y, message.r], False
    if message.z != NO_STICK:
        centre = min(throttles, key=lambda each: abs(message.z - each))
        has_jumped = client.throttle_centre not in (None, centre)
        client.throttle_centre = centre
        sticks.append(message.z - centre)
    return has_jumped or any(abs(s) > STICKS_CENTRED for s in sticks if s != NO_STICK)


R = TaskReason


class _Asker(NamedTuple):
    """The sender of a forwarded command: endpoint, address there, and the component addressed.

    ``halt``: the command, if it halts the rover.
    """

    client: Place
    source: Address
    answering: Address
    halt: Said | None


def check_relay(asked: CommandRequest, row: Row, *, now: float) -> None:
    """Raise Rejection if a command may not go to its vehicle now, else note its effect."""
    vehicle, command = asked.vehicle, asked.command
    number, params = command.command, command.params
    what, moves = f"send command {number} to a rover", not row.passes_under_stop
    asked.rights.require(row.role, what, moves=moves)
    if vehicle.tasks.is_stopped and not row.passes_under_stop:
        raise Rejection(R.STOPPED, CONTINUE_FIRST)
    takes_over = number == MavCmd.DO_REPOSITION and bool(reposition_flags(command) & CHANGE_MODE)
    if why_not := why_not_sent(row, vehicle, asked.client.key, takes_over=takes_over):
        raise Rejection(R.NOT_ALLOWED, f"command {number}: {why_not}")
    if number in (MavCmd.DO_CHANGE_SPEED, MavCmd.NAV_SET_YAW_SPEED) and not isfinite(params[1]):
        raise Rejection(R.BAD_PARAMETER, "param2 speed is not given")  # makes an autopilot abort
    if takes_over:
        vehicle.joint.client_asks_mode(vehicle.persona.control_mode, asked.client.key, now=now)
    if row.needs_grant:
        vehicle.parts.authority.note_client(asked.client.key, now=now)


def relay(asked: CommandRequest, *, now: float) -> None:
    """Forward a command; ``deliver`` brings its answer to the client."""
    command = asked.command
    answering = Address(asked.vehicle.system_id, command.target.component_id or AUTOPILOT)
    halt = asked.said if asked.kind is Kind.HALT else None
    asker = _Asker(asked.client.key, asked.packet.source, answering, halt)
    asked.vehicle.relay(
        asked.packet,
        command.message,
        asker,
        command=command.command,
        actor=asked.actor,
        standing=Standing(asked.client.key, ROLES.index(asked.rights.role)),
        now=now,
    )


def _disarms(request: Message) -> bool:
    if not isinstance(request, CommandLong | CommandInt):
        return False
    return (request.command, request.param1) == (MavCmd.COMPONENT_ARM_DISARM, 0.0)


def deliver(
    gcs: GcsSide, submissions: Submissions, vehicle: Vehicle, answered: Answered, *, now: float
) -> None:
    """Answer the client with the vehicle's answer, or with a refusal if there is none."""
    asker = answered.origin
    assert isinstance(asker, _Asker), "only relay gives commands an origin"
    client, ack, command = gcs.client(asker.client), answered.ack, answered.command
    if ack is not None and ack.result == MavResult.IN_PROGRESS:
        if client is not None:
            told = Answer(command, ack.result, ack.result_param2, asker.answering, ack.progress)
            client.answer(told, asker.source)
        return
    is_accepted = ack is not None and ack.result == MavResult.ACCEPTED
    if is_accepted and _disarms(answered.request):
        vehicle.parts.armings.was_disarmed = True  # the answer may belong to an older disarming
    if command == MavCmd.COMPONENT_ARM_DISARM and ack and not is_accepted:
        vehicle.parts.armings.client_at = -inf  # if it shows armed now, somebody else did it
    if client is None:
        return
    if ack is not None:
        result, param2 = ack.result, ack.result_param2
        # beyond CANCELLED (COMMAND_INT_ONLY and the like) a result crashes MAVSDK; some autopilots
        # answer FAILED for an unknown message
        is_unknown = command == MavCmd.REQUEST_MESSAGE and result == MavResult.FAILED
        if is_unknown or result > MavResult.CANCELLED:
            result = MavResult.UNSUPPORTED
    elif answered.was_sent and command == MavCmd.REQUEST_MESSAGE:
        result, param2 = MavResult.UNSUPPORTED, 0
    else:
        result, param2 = MavResult.TEMPORARILY_REJECTED, int(R.RATE_LIMITED)
        words, severity = f"rover {vehicle.system_id} is busy, try again", MavSeverity.INFO
        if answered.was_sent:
            words, severity = f"no answer from rover {vehicle.system_id}", MavSeverity.WARNING
            param2 = int(R.VEHICLE_SILENT)
        client.tell(f"command {command}: {words}", severity, vehicle.server_address, now=now)
    answer = Answer(command, result, param2, asker.answering)
    if asker.halt is not None:
        asker.halt.answer = answer
    if asker.halt is None or answer.result not in IN_FORCE:
        client.answer(answer, asker.source)
    else:
        submissions.answer_halt(client, asker.halt, asker.source, now=now)


class Forwarder:
    """The forwarder of client packets to vehicles."""

    def __init__(self, vehicles: VehicleSide, refusals: Refusals) -> None:
        self._refusals = refusals
        self._vehicles = vehicles
        self._writers = file_transfer.Writers()

    def forward(self, received: Received, *, now: float) -> None:
        """Forward a packet to its target vehicles, unless it is for the task server.

        Without a ``message`` its id is unknown and its bytes are unverified. Noise may look so; its
        refusal is not logged.
        """
        client, packet, message = received.client, received.packet, received.message
        row = received.row.passed_on
        target = EVERYBODY if message is None else _target(message)
        why_not = self._why_not(client, row, message, now=now)
        if why_not is not None:
            if message is not None and row.kind is not Kind.TELL:
                self._refusals.stream(client, target.system_id, packet, why_not, now=now)
            return
        behind: dict[Place, list[Vehicle]] = {}  # a radio may have several
        for vehicle in self._vehicles.addressed_by(target.system_id):
            if target != vehicle.server_address:
                behind.setdefault(vehicle.requests.place, []).append(vehicle)
            elif isinstance(message, m.FileTransferProtocol):
                refusal = file_transfer.refusal(message, to=packet.source)
                if refusal is not None:
                    client.outlet.send(refusal, vehicle.server_address)
        for vehicles in behind.values():
            refusing = [v for v in vehicles if not may_pass(v, client, row, message)]
            too_much = (
                self._vehicles.why_not_asked(vehicles[0], client.key, packet, message, now=now)
                if client.is_observer and message is not None
                else None
            )
            if too_much is not None:
                self._refuse_question(client, vehicles[0], packet, too_much, now=now)
                continue
            if not refusing:
                for vehicle in vehicles:
                    passed(vehicle, client, row, message, now=now)
                vehicles[0].requests.forward(packet)
                continue
            for vehicle in vehicles if row.needs_grant else ():
                vehicle.parts.authority.withheld = client.key, now
            for vehicle in refusing if message is not None else ():
                words = why_not_sent(row, vehicle, client.key)
                if row.needs_grant and words == UNARMED:
                    vehicle.pilot.stand_in(now=now)
                words = words or "a number is not finite, or the server delayed it"
                words = f"setpoints dropped: {words}" if row.needs_grant else words
                why_not = Rejection(R.NOT_ALLOWED, words)
                self._refusals.stream(client, vehicle.system_id, packet, why_not, now=now)

    def _refuse_question(
        self, client: GcsClient, vehicle: Vehicle, packet: Packet, why: str, *, now: float
    ) -> None:
        """Refuse an observer's question with a text: MAVLink has no answer for that."""
        refusal = client.rights.refusal(why, R.RATE_LIMITED)
        client.tell_refusal(refusal.text, vehicle.server_address, now=now)
        self._refusals.stream(client, vehicle.system_id, packet, refusal, now=now)

    def _why_not(
        self, client: GcsClient, row: Row, message: m.Message | None, *, now: float
    ) -> Rejection | None:
        """Return why a packet may go to no rover, or None if it may."""
        try:
            what, moves = "send this message to a rover", not row.passes_under_stop
            client.rights.require(row.role, what, moves=moves)
        except Rejection as refusal:
            return refusal
        if isinstance(message, m.FileTransferProtocol):
            is_safety = client.rights.reach(SAFETY)
            if not is_safety and self._writers.ends_anothers(message, client.key, now=now):
                return client.rights.refusal(
                    "may not end this session: another client writes a file"
                )
            self._writers.note(message, client.key, now=now)
        return None

    def end(self, link: str, peer: Peer, *, now: float) -> None:
        """Stop the vehicles that a client was driving, because it is gone."""
        for vehicle in self._vehicles.all:
            if vehicle.parts.authority.forget((link, peer)):
                self._vehicles.mark_dirty(vehicle)
                vehicle.joint.on(Event.GONE, Word(), now=now)


def _target(message: m.Message) -> Address:
    """Return the target of a message; 0 means all."""
    if isinstance(message, m.ManualControl):  # it names its target ``target``
        return Address(message.target, 0)
    return target_of(message)
