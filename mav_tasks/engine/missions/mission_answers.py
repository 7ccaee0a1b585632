"""Answers to one client of the mission protocol: messages, and texts of refusals."""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult, MavSeverity
from mav_tasks.services.mission_receiver import Sender, ToClient
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry


class MissionAnswers:
    """The sender of answers, for as long as their client is there."""

    def __init__(self, gcs: GcsSide, registry: TaskRegistry) -> None:
        self._gcs = gcs
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

    def tell(self, sender: Sender, vehicle: Vehicle, words: str, *, now: float) -> None:
        """Send a warning text to the sender's client."""
        if client := self.client(sender):
            client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)

    def refused(
        self, sender: Sender, vehicle: Vehicle, refusal: Rejection, *, message_id: int, now: float
    ) -> None:
        """Tell the client why a request was refused, and record it; ``message_id`` 0: an upload."""
        by, number = vehicle.server_address, vehicle.system_id
        self.refused_at(sender, by, number, refusal, message_id=message_id, now=now)

    def refused_at(
        self,
        sender: Sender,
        by: Address,
        vehicle: int,
        refusal: Rejection,
        *,
        message_id: int,
        now: float,
    ) -> None:
        """Do the same in the name of ``by``; ``vehicle``: a system id, or ANY."""
        client = self.client(sender)
        if client is not None and not client.may_be_refused(now=now):
            return  # a flood of refusals fills neither disk nor network
        if client is not None:
            client.tell_refusal(refusal.text, by, now=now)
        reason, actor = TaskReason(refusal.reason), str(sender.address)
        self._registry.record(
            SubmissionRefused(vehicle, -message_id, reason, refusal.text, actor, now)
        )
