"""Answers to one client of the mission protocol: messages, and texts of refusals."""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_receiver import Sender, ToClient
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import ANY


class MissionAnswers:
    """The sender of answers, for as long as their client is there."""

    def __init__(self, gcs: GcsSide, vehicles: VehicleSide, registry: TaskRegistry) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._registry = registry

    def client(self, sender: Sender) -> GcsClient | None:
        """Return the client of a mission sender, None if it is gone."""
        assert isinstance(sender.key, tuple), "only MissionServers.receive makes senders"
        key, _signed_by = sender.key
        return self._gcs.client(key)

    def send(self, told: ToClient) -> None:
        """Send a message in the name of the address that the client addressed."""
        if client := self.client(told.sender):
            client.outlet.send(told.message, told.sender.addressed)

    def ack(self, sender: Sender, kind: int, result: MavMissionResult, reason: int = 0) -> None:
        """Send a MISSION_ACK that names no plan, but the reason of a refusal."""
        self.send(ToClient(sender, m.MissionAck(*sender.address, result, kind, reason)))

    def refused(
        self, sender: Sender, refusal: Rejection, *, now: float, message_id: int = 0
    ) -> None:
        """Tell the client why a request was refused, and record it; ``message_id`` 0: an upload."""
        client, vehicle = self.client(sender), self._vehicles.look_at(sender.addressed.system_id)
        if client is not None and not client.may_be_refused(now=now):
            return  # a flood of refusals fills neither disk nor network
        if client is not None:
            by = vehicle.server_address if vehicle else self._vehicles.our_address
            client.tell_refusal(refusal.text, by, now=now)
        number, reason = vehicle.system_id if vehicle else ANY, TaskReason(refusal.reason)
        self._registry.record(
            SubmissionRefused(number, -message_id, reason, refusal.text, str(sender.address), now)
        )
