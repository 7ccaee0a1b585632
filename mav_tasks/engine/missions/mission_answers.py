"""What clients of the mission protocol are told: messages to one of them, and why not in words."""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavMissionResult, MavSeverity
from mav_tasks.services.mission_receiver import Sender, ToClient
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry


class MissionAnswers:
    """Answers to whoever asked, while that client is still there."""

    def __init__(self, gcs: GcsSide, registry: TaskRegistry) -> None:
        self._gcs = gcs
        self._registry = registry

    def client(self, sender: Sender) -> GcsClient | None:
        """Return the client that a sender is at, if it is still there."""
        assert isinstance(sender.key, tuple), "only MissionServers.receive makes senders"
        key, _signed_by = sender.key
        return self._gcs.client(key)

    def send(self, told: ToClient) -> None:
        """Send a message in the name of the address that was spoken to."""
        client = self.client(told.sender)
        if client is not None:
            client.outlet.send(told.message, told.sender.addressed)

    def ack(self, sender: Sender, kind: int, result: MavMissionResult) -> None:
        """Send a MISSION_ACK that names no plan."""
        self.send(ToClient(sender, m.MissionAck(*sender.address, result, kind)))

    def tell(self, sender: Sender, vehicle: Vehicle, words: str, *, now: float) -> None:
        """Say in words why not."""
        client = self.client(sender)
        if client is not None:
            client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)

    def refused(
        self, sender: Sender, vehicle: Vehicle, refusal: Rejection, *, message_id: int, now: float
    ) -> None:
        """Say why a request was refused: to its client, and in the log; 0: it is an upload."""
        client = self.client(sender)
        if client is not None and not client.may_be_refused(now=now):
            return  # a flood of them fills neither disk nor net
        if client is not None:
            client.tell_refusal(refusal.text, vehicle.server_address, now=now)
        reason, actor = TaskReason(refusal.reason), str(sender.address)
        self._registry.record(
            SubmissionRefused(vehicle.system_id, -message_id, reason, refusal.text, actor, now)
        )
