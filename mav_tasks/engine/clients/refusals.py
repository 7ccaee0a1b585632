"""Refuses client packets with a borrowed source address and requests above the rate limit, and
records refused client messages for the journal and the log: who, what and why.

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

A command is refused in its acknowledgement (``CommandRequest``). ``message`` and ``stream`` record
messages without one: of the mission protocol, SET_MODE, and streams, whose client is told once in
STREAM_EACH seconds.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field
from math import inf

from mav_tasks.basics.errors import Rejection
from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR
from mav_tasks.engine.commands.translate import result_of
from mav_tasks.engine.policy import Kind
from mav_tasks.engine.services.commands import Answer
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry

ITEMS = 20  # of a plan, that count as one more change
STREAM_EACH = 30.0  # s, the log's own window for repeated texts
REMEMBERED = 256  # streams of clients


@dataclass(repr=False, eq=False)
class Refusals:
    """The check of each client packet, and the recorder of refusals, limited for each client."""

    _registry: TaskRegistry
    _vehicles: VehicleSide
    #: requests dropped because they were too many
    left_out: int = 0
    _streams: dict[Hashable, float] = field(default_factory=dict)  # when each was recorded last

    def may_pass(self, received: Received, *, now: float) -> bool:
        """Whether a client's packet is processed; the sender of a refused command is told."""
        client, packet, message = received.client, received.packet, received.message
        command, row, rights, source = received.command, received.row, client.rights, packet.source
        if command is not None and command.command == MavCmd.TASK_STOP:
            return True
        vehicle, owner = self._vehicles.look_at(source.system_id), ""
        if vehicle is not None and source.component_id in vehicle.components:
            owner = "taken on the rover's side"
        elif source == self._vehicles.our_address:
            owner = "the server's"
        if owner:
            # noise may look so, and nobody waits for an answer to a heartbeat
            if message is not None and row.kind is not Kind.TELL:
                words = f"address {source} is {owner}: change this client's component id"
                self._refuse(received, message, Rejection(TaskReason.NOT_ALLOWED, words), now=now)
                words = f"component {source} on its side and the client at {client.endpoint}"
                words += " have one address: change one's component id"
                if vehicle and self._vehicles.note_once(vehicle.system_id, words, now=now):
                    vehicle.requests.tell(words, vehicle.server_address)
            return False
        if not row.is_counted and (row.role != OBSERVER or rights.reach(OPERATOR)):
            return True
        what, rate = "requests", rights.limits.rate
        is_taken = client.requests.take(now=now)
        if is_taken and row.is_claimed and row.kind in (Kind.WISH, Kind.GO):
            items = message.count if isinstance(message, m.MissionCount) else 0
            is_taken = client.changes.take(tokens=min(1 + items // ITEMS, rate), now=now)
            what, rate = "changes", client.changes.rate
        if not is_taken:
            self.left_out += 1
            if command is not None and message is not None:
                refusal = rights.refusal(
                    f"may send {rate:g} {what} per second", TaskReason.RATE_LIMITED
                )
                self._refuse(received, message, refusal, now=now)
        return is_taken

    def _refuse(
        self, received: Received, message: m.Message, refusal: Rejection, *, now: float
    ) -> None:
        """Record a refusal; answer a command, unless the client's commands are a flood."""
        client, packet, command = received.client, received.packet, received.command
        target = target_of(message)
        if command is None:
            self.stream(client, target.system_id, packet, refusal, now=now)
        elif client.may_be_refused(now=now):
            self.stream(client, target.system_id, packet, refusal, now=now)
            if vehicle := self._vehicles.look_at(target.system_id):
                ours, result = vehicle.server_address, result_of(refusal.reason)
                source = Address(target.system_id, target.component_id or ours.component_id)
                answer = Answer(command.command, result, refusal.reason, source)
                client.answer(answer, packet.source)
                client.tell_refusal(refusal.text, ours, now=now)

    def stream(
        self, client: GcsClient, system_id: int, packet: Packet, refusal: Rejection, *, now: float
    ) -> None:
        """Record a refused message of a stream, and tell its client, once in STREAM_EACH seconds.

        The text comes from the rover that the message is for, or from the one of which its sender
        claims to be a component: mavros shows texts of its own system only.
        """
        key = client.key, packet.source, system_id, packet.message_id, refusal.text
        if now - self._streams.get(key, -inf) < STREAM_EACH:
            return
        if self.message(client, system_id, packet, refusal, now=now):
            keep_latest(self._streams, key, now, most=REMEMBERED)
            look_at = self._vehicles.look_at
            if vehicle := look_at(system_id) or look_at(packet.system_id):
                client.tell_refusal(refusal.text, vehicle.server_address, now=now)

    def message(
        self, client: GcsClient, system_id: int, packet: Packet, refusal: Rejection, *, now: float
    ) -> bool:
        """Record a refused message. Return False if too many were refused: ignore it."""
        if not client.may_be_refused(now=now):
            return False
        reason, actor = TaskReason(refusal.reason), str(client.submitter(packet.source))
        self._registry.record(
            SubmissionRefused(system_id, -packet.message_id, reason, refusal.text, actor, now)
        )
        return True
