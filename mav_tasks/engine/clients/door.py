"""Drops client packets with a borrowed source address, and requests above the rate limit.

Packets from the address of the server or of a rover are dropped: they come from a loop in the
network, or from a client that hides. A command from there is denied, so that a misconfigured ground
station shows why nothing happens. STOP is accepted from any address, and is never rate-limited.

Packets of a transfer under way, heartbeats and manual control are not counted: their rate is
limited before parsing. From a client below operator, every message that an observer may send is
counted, because the link to the rover may be slow.

What is stored, or lets a rover go, has a smaller limit besides, for it may fill the disk.
"""

from mav_tasks.engine.clients.gcs_client import changes_of
from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR
from mav_tasks.engine.commands.translate import result_of
from mav_tasks.engine.commands.words import row_said
from mav_tasks.engine.policy import Kind, row_of
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.services.command_receiver import Answer, command_of, is_stop
from mav_tasks.tasks.lifecycle import TaskReason

ITEMS = 20  # of a plan, that count as one more change


class Door:
    """The check of each client packet: its source address and the client's request rate."""

    def __init__(self, vehicles: VehicleSide, refusals: Refusals) -> None:
        self._refusals = refusals
        self._vehicles = vehicles
        #: requests dropped because they were too many
        self.left_out = 0

    def may_pass(self, received: Received, *, now: float) -> bool:
        """Whether a client's packet is processed; the sender of a refused command is told."""
        client, packet, message = received.client, received.packet, received.message
        if is_stop(message):
            return True
        row = row_of(packet.message_id, message)
        if self._is_ours(packet.source):
            if message is not None and row.kind is not Kind.TELL:
                words = f"address {packet.source} belongs to the server or a rover: use another"
                self._refuse(received, message, Rejection(TaskReason.NOT_ALLOWED, words), now=now)
            # noise may look so, and nobody waits for an answer to a heartbeat
            return False
        is_counted = row.is_counted or (row.role == OBSERVER and not client.rights.reach(OPERATOR))
        if not is_counted:
            return True
        rights, what, rate = client.rights, "requests", client.rights.limits.rate
        is_taken = client.requests.take(now=now)
        if isinstance(message, m.CommandLong | m.CommandInt):
            row = row_said(command_of(message))
        if is_taken and row.is_claimed and row.kind in (Kind.WISH, Kind.GO):
            items = message.count if isinstance(message, m.MissionCount) else 0
            is_taken = client.changes.take(tokens=min(1 + items // ITEMS, rate), now=now)
            what, rate = "changes", changes_of(rate)
        if is_taken:
            return True
        self.left_out += 1
        if isinstance(message, m.CommandLong | m.CommandInt):
            words = f"may send {rate:g} {what} per second"
            refusal = rights.refusal(words, TaskReason.RATE_LIMITED)
            self._refuse(received, message, refusal, now=now)
        return False

    def _is_ours(self, source: Address) -> bool:
        """Whether a client's packet names an address of the server or of a rover as its own."""
        vehicle = self._vehicles.look_at(source.system_id)
        return source == self._vehicles.our_address or (
            vehicle is not None
            and (source == vehicle.server_address or source.component_id == AUTOPILOT)
        )

    def _refuse(
        self, received: Received, message: m.Message, refusal: Rejection, *, now: float
    ) -> None:
        """Record a refusal; answer a command, unless the client's commands are a flood."""
        client, packet = received.client, received.packet
        is_command = isinstance(message, m.CommandLong | m.CommandInt)
        if is_command and not client.may_be_refused(now=now):
            return
        self._refusals.stream(client, target_of(message).system_id, packet, refusal, now=now)
        vehicle = self._vehicles.look_at(target_of(message).system_id)
        if vehicle is None or not isinstance(message, m.CommandLong | m.CommandInt):
            return
        component = message.target_component or vehicle.server_component
        source = Address(vehicle.system_id, component)
        result = result_of(refusal.reason)
        client.answer(Answer(message.command, result, refusal.reason, source), packet.source)
        client.tell(refusal.text, MavSeverity.WARNING, vehicle.server_address, now=now)
