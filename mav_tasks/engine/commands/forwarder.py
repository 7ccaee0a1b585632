"""Forwards clients' packets that the server does not claim, and drops those not allowed.

A packet goes to the link on which its target was seen.
"""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import SAFETY
from mav_tasks.engine.commands.motion_gate import UNARMED, may_pass, passed, why_not_sent
from mav_tasks.engine.inputs import Peer, Place
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services import file_transfer
from mav_tasks.tasks.lifecycle import TaskReason

R = TaskReason

EVERYBODY = Address(0, 0)


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
                vehicle.parts.authority.note_withheld(client.key, now=now)
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
            if vehicle.parts.authority.has_granted((link, peer)):
                self._vehicles.mark_dirty(vehicle)
                vehicle.joint.client_is_gone((link, peer), now=now)


def _target(message: m.Message) -> Address:
    """Return the target of a message; 0 means all."""
    if isinstance(message, m.ManualControl):  # it names its target ``target``
        return Address(message.target, 0)
    return target_of(message)
