"""Forwards commands that the server does not claim to vehicles, and returns their answers."""

from math import isfinite
from typing import NamedTuple

from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.sender import Said
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.commands.goals import CHANGE_MODE, reposition_flags
from mav_tasks.engine.commands.motion_gate import why_not_sent
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.commands.translate import IN_FORCE
from mav_tasks.engine.inputs import Place
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.messages import CommandInt, CommandLong, Message
from mav_tasks.services.command_receiver import Answer
from mav_tasks.services.command_sender import Answered, Standing
from mav_tasks.settings import ROLES
from mav_tasks.tasks.lifecycle import CONTINUE_FIRST, TaskReason

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
    is_accepted = answered.ack is not None and answered.ack.result == MavResult.ACCEPTED
    if is_accepted and _disarms(answered.request):
        vehicle.parts.armings.was_answered()
    if answered.command == MavCmd.COMPONENT_ARM_DISARM and answered.ack and not is_accepted:
        vehicle.parts.armings.client_was_refused()
    client = gcs.client(asker.client)
    if client is None:
        return
    ack, command = answered.ack, answered.command
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
