"""Handles a mission item with ``current`` 2: "go there now", ArduPilot's older way.

QGroundControl sends it beside DO_REPOSITION while it does not know whether the autopilot supports
that; both are one task. The answer is a MISSION_ACK.
"""

from math import inf

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.missions.plan_items import result_of
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavMissionType, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import NO_MESSAGE, Command
from mav_tasks.services.mission_item import item_of
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry

ONLY_HIGHER = 3  # MISSION_ITEM.current; 2 is a place to go to


class GuidedItemRequest(CommandRequest):
    """A request by mission item, answered with a MISSION_ACK."""

    @property
    def is_go_to(self) -> bool:
        """True: the item is always a "go to"."""
        return True

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Send the MISSION_ACK of an accepted item; ``refuse`` sends all others."""
        assert result is MavResult.ACCEPTED, "refusals have a result of their own"
        self._ack(MavMissionResult.ACCEPTED, opaque_id=result_param2)

    def refuse(
        self, refusal: Rejection, *, now: float, result: MavResult | None = None
    ) -> SubmissionRefused:
        """Answer with the result and a text; return the event for the audit log."""
        del result
        self._ack(result_of(refusal))
        self.tell(refusal.text, MavSeverity.ERROR, now=now)
        reason, number = TaskReason(refusal.reason), self.command.command
        return SubmissionRefused(
            self.vehicle.system_id, number, reason, refusal.text, self.actor, now
        )

    def _ack(self, result: MavMissionResult, *, opaque_id: int = 0) -> None:
        ack = m.MissionAck(*self.packet.source, result, MavMissionType.MISSION, opaque_id)
        self.client.outlet.send(ack, self.answering)


class GoToItems:
    """The handler of "go to" items."""

    def __init__(self, submissions: Submissions, registry: TaskRegistry) -> None:
        self._submissions = submissions
        self._registry = registry

    def receive(
        self,
        client: GcsClient,
        vehicle: Vehicle,
        packet: Packet,
        message: m.MissionItem | m.MissionItemInt,
        *,
        now: float,
    ) -> None:
        """Submit a "go to". An item that only changes the altitude is accepted without effect."""
        sender = client.sender(packet.source)
        said = sender.take_in(_command_of(message), packet.raw, now=now)
        asked = GuidedItemRequest(client, vehicle, packet, said)
        try:
            if message.current == ONLY_HIGHER:
                asked.answer(MavResult.ACCEPTED)
                return
            if message.command != MavCmd.NAV_WAYPOINT:
                words = f"command {message.command} is not a place"
                raise Rejection(TaskReason.NOT_SUPPORTED_BY_VEHICLE, words)
            self._submissions.submit(asked, now=now)
        except Rejection as refusal:
            if client.may_be_refused(now=now):
                self._registry.record(asked.refuse(refusal, now=now))


def _command_of(message: m.MissionItem | m.MissionItemInt) -> Command:
    """Return the command that an item stands for; a place out of range becomes infinite."""
    item = item_of(message)
    x, y = (inf, inf) if item is None else (float(item.x), float(item.y))
    first = (message.param1, message.param2, message.param3, message.param4)
    target = Address(message.target_system, message.target_component or AUTOPILOT)
    return Command(target, message.command, (*first, x, y, message.z), 0, message.frame, NO_MESSAGE)
