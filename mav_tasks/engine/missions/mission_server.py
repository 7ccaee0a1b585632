"""Dispatches clients' mission protocol messages, by address and plan type, to the transfers."""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.engine.missions.plan_transfer import MissionMessage, PlanTransfer, UploadMessage
from mav_tasks.engine.missions.plans import MISSION, STORED
from mav_tasks.engine.missions.transfer import MissionParts
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import Packet
from mav_tasks.settings import Settings
from mav_tasks.tasks.deduplicator import reused

__all__ = ["MissionMessage", "MissionServers"]


class MissionServers:
    """The servers of the mission protocol at all addresses."""

    def __init__(self, parts: MissionParts) -> None:
        self._parts = parts
        self._transfers: dict[tuple[int, Address, int], PlanTransfer] = {}

    def apply(self, settings: Settings) -> None:
        self._parts.settings = settings

    def nonce_taken(self, taken: NonceTaken, *, now: float) -> None:
        """Answer an upload with the task that the fleet had with its nonce."""
        task = self._parts.registry.get(taken.task_id)
        if task is not None and task.command == MavCmd.MISSION_START:
            is_same = taken.payload == task.marks.payload
            answer = taken.known if is_same else reused(task.marks.nonce)
            self._transfer(None, self._parts.vehicles.our_address, MISSION).finish(answer, now=now)

    def forget(self, vehicle: int) -> None:
        """End the transfers of a vehicle's plans: clients begin again at its next gateway."""
        for key in [each for each in self._transfers if each[0] == vehicle]:
            self._parts.timers.forget(self._transfers.pop(key).timer)

    def receive(
        self, client: GcsClient, packet: Packet, message: MissionMessage, *, now: float
    ) -> bool:
        """Handle a client's message. Return False if it is not for the server."""
        vehicles, component = self._parts.vehicles, message.target_component
        # most messages leave the vehicle as it is; the others mark it dirty
        vehicle = vehicles.look_at(message.target_system)
        if vehicle is None:
            ours = vehicles.our_address
            address = Address(message.target_system, component or ours.component_id)
            is_ours = address == ours and isinstance(message, UploadMessage)
        else:
            address = Address(vehicle.system_id, component or AUTOPILOT)
            is_claimed = address.component_id == AUTOPILOT and vehicle.parts.settings.claim
            is_ours = is_claimed or address.component_id == vehicle.server_component
        if is_ours:
            kind = getattr(message, "mission_type", MISSION)
            self._transfer(vehicle, address, kind).receive(client, packet, message, now=now)
        return is_ours

    def _transfer(self, vehicle: Vehicle | None, address: Address, kind: int) -> PlanTransfer:
        """Return the transfers of plans of a type; those of an unknown one are not remembered."""
        key = 0 if vehicle is None else vehicle.system_id, address, kind
        transfer = self._transfers.get(key)
        if transfer is None:
            transfer = PlanTransfer(self._parts, vehicle, address, kind)
            if kind in STORED:
                self._transfers[key] = transfer
        return transfer
