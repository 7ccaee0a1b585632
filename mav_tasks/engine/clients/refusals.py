"""Records refused client messages for the journal and the log: who, what and why.

A command is refused in its acknowledgement (``CommandRequest``). Here are messages without one: of
the mission protocol, SET_MODE, and streams, whose client is told once in STREAM_EACH seconds.
"""

from collections.abc import Hashable

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.latest import keep_latest
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry

STREAM_EACH = 30.0  # s, the log's own window for repeated texts
REMEMBERED = 256  # streams of clients


class Refusals:
    """The recorder of refusals, limited in rate for each client."""

    def __init__(self, registry: TaskRegistry, vehicles: VehicleSide) -> None:
        self._registry = registry
        self._vehicles = vehicles
        self._streams: dict[Hashable, float] = {}  # when each was recorded last

    def message(
        self, client: GcsClient, vehicle: Vehicle, packet: Packet, refusal: Rejection, *, now: float
    ) -> bool:
        """Record a refused message. Return False if too many were refused: ignore it."""
        if not client.may_be_refused(now=now):
            return False
        self._record(client, vehicle.system_id, packet, refusal, now=now)
        return True

    def stream(
        self, client: GcsClient, system_id: int, packet: Packet, refusal: Rejection, *, now: float
    ) -> None:
        """Record a refused message of a stream, and tell its client, once in STREAM_EACH seconds.

        The text comes from the rover that the message is for, or from the one of which its sender
        claims to be a component: mavros shows texts of its own system only.
        """
        key = (client.key, packet.source, system_id, packet.message_id, refusal.text)
        if now - self._streams.get(key, -STREAM_EACH) < STREAM_EACH:
            return
        if not client.may_be_refused(now=now):
            return
        keep_latest(self._streams, key, now, most=REMEMBERED)
        self._record(client, system_id, packet, refusal, now=now)
        look_at = self._vehicles.look_at
        if vehicle := look_at(system_id) or look_at(packet.system_id):
            client.tell_refusal(refusal.text, vehicle.server_address, now=now)

    def _record(
        self, client: GcsClient, system_id: int, packet: Packet, refusal: Rejection, *, now: float
    ) -> None:
        reason, actor = TaskReason(refusal.reason), str(client.submitter(packet.source))
        self._registry.record(
            SubmissionRefused(system_id, -packet.message_id, reason, refusal.text, actor, now)
        )
