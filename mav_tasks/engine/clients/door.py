"""Drops client packets with a borrowed source address, and requests above the rate limit.

Packets from the server's own address, or from that of a rover's autopilot or of a component on the
rover's side, are dropped: they come from a loop in the network, or from a client that would get
the other's answers. Its sender is told, and so is that component. STOP is accepted from any
address, and is never rate-limited.

The task server's address in a rover's system stays free for clients: mavros has it by default. The
server is there for clients only, and no client hears another; to rovers it is the server's own.

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
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import target_of
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
        if owner := self._owner_of(packet.source):
            if message is not None and row.kind is not Kind.TELL:
                words = f"address {packet.source} is {owner}: change this client's component id"
                self._refuse(received, message, Rejection(TaskReason.NOT_ALLOWED, words), now=now)
                self._tell_owner(received, now=now)
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

    def _owner_of(self, source: Address) -> str:
        """Return whose address a client's packet names as its own, in words; "" if it is free."""
        vehicle = self._vehicles.look_at(source.system_id)
        if vehicle is not None and source.component_id in vehicle.components:
            return "taken on the rover's side"
        return "the server's" if source == self._vehicles.our_address else ""

    def _tell_owner(self, received: Received, *, now: float) -> None:
        """Tell a component on the rover's side, and everybody, that a client has its address."""
        source = received.packet.source
        vehicle = self._vehicles.look_at(source.system_id)
        if vehicle is not None:
            words = f"component {source} on its side and the client at {received.client.endpoint}"
            words += " have one address: change one's component id"
            if self._vehicles.note_once(source.system_id, words, now=now):
                vehicle.requests.tell(words, vehicle.server_address)

    def _refuse(
        self, received: Received, message: m.Message, refusal: Rejection, *, now: float
    ) -> None:
        """Record a refusal; answer a command, unless the client's commands are a flood."""
        client, packet, target = received.client, received.packet, target_of(message)
        is_command = isinstance(message, m.CommandLong | m.CommandInt)
        if is_command and not client.may_be_refused(now=now):
            return
        self._refusals.stream(client, target.system_id, packet, refusal, now=now)
        vehicle = self._vehicles.look_at(target.system_id)
        if vehicle is not None and isinstance(message, m.CommandLong | m.CommandInt):
            source = Address(target.system_id, target.component_id or vehicle.server_component)
            result = result_of(refusal.reason)
            client.answer(Answer(message.command, result, refusal.reason, source), packet.source)
            client.tell_refusal(refusal.text, vehicle.server_address, now=now)
