"""Drops client packets with a borrowed source address, and requests above the rate limit.

Packets from the address of the server or of a rover are dropped: they come from a loop in the
network, or from a client that hides. A command from there is denied, so that a misconfigured ground
station shows why nothing happens. STOP is accepted from any address, and is never rate-limited.

Packets of a transfer under way, heartbeats and manual control are not counted: their rate is
limited before parsing. From a client below operator, every message that an observer may send is
counted, because the link to the rover may be slow.
"""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR
from mav_tasks.engine.policy import Kind, row_of
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import Answer, is_stop
from mav_tasks.tasks.lifecycle import TaskReason


class Door:
    """The check of each client packet: its source address and the client's request rate."""

    def __init__(self, vehicles: VehicleSide, refusals: Refusals) -> None:
        self._refusals = refusals
        self._vehicles = vehicles
        #: requests dropped because they were too many
        self.left_out = 0

    def may_pass(
        self, client: GcsClient, packet: Packet, message: m.Message | None, *, now: float
    ) -> bool:
        """Whether a client's packet is processed; the sender of a refused command is told."""
        if is_stop(message):
            return True
        if self._is_ours(packet.source):
            self._turn_away(client, packet, message, now=now)
            return False
        row = row_of(packet.message_id, message)
        is_counted = row.is_counted or (row.role == OBSERVER and not client.rights.reach(OPERATOR))
        if not is_counted or client.requests.take(now=now):
            return True
        self.left_out += 1
        if isinstance(message, m.CommandLong | m.CommandInt) and client.may_be_refused(now=now):
            self._tell_rate(client, packet, message, now=now)
        return False

    def _is_ours(self, source: Address) -> bool:
        """Whether a client's packet names an address of the server or of a rover as its own."""
        vehicle = self._vehicles.look_at(source.system_id)
        return source == self._vehicles.our_address or (
            vehicle is not None
            and (source == vehicle.server_address or source.component_id == AUTOPILOT)
        )

    def _turn_away(
        self, client: GcsClient, packet: Packet, message: m.Message | None, *, now: float
    ) -> None:
        if message is None or row_of(packet.message_id, message).kind is Kind.TELL:
            return  # noise may look so, and nobody waits for an answer to a heartbeat
        words = f"address {packet.source} belongs to the server or a rover: use another"
        refusal = Rejection(TaskReason.NOT_ALLOWED, words)
        if isinstance(message, m.CommandLong | m.CommandInt):
            if client.may_be_refused(now=now):
                self._refuse(client, packet, message, MavResult.DENIED, refusal, now=now)
        else:
            self._refusals.stream(client, target_of(message).system_id, packet, refusal, now=now)

    def _tell_rate(
        self,
        client: GcsClient,
        packet: Packet,
        message: m.CommandLong | m.CommandInt,
        *,
        now: float,
    ) -> None:
        rights = client.rights
        words = f"too many requests: role {rights.role} may send {rights.limits.rate:g} per second"
        refusal = Rejection(TaskReason.RATE_LIMITED, words)
        result = MavResult.TEMPORARILY_REJECTED
        self._refuse(client, packet, message, result, refusal, now=now)

    def _refuse(
        self,
        client: GcsClient,
        packet: Packet,
        message: m.CommandLong | m.CommandInt,
        result: MavResult,
        refusal: Rejection,
        *,
        now: float,
    ) -> None:
        self._refusals.stream(client, message.target_system, packet, refusal, now=now)
        vehicle = self._vehicles.look_at(message.target_system)
        if vehicle is None:
            return
        component = message.target_component or vehicle.server_component
        source = Address(vehicle.system_id, component)
        client.answer(Answer(message.command, result, refusal.reason, source), packet.source)
        client.tell(refusal.text, MavSeverity.WARNING, vehicle.server_address, now=now)
