"""A mission item with ``current`` 2: "go there now", ArduPilot's older way.

QGroundControl sends it beside DO_REPOSITION while it does not know whether the autopilot supports
that; both are one task. The answer is a MISSION_ACK.
"""

from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.missions.plan_items import result_of
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavMissionResult, MavMissionType, MavResult
from mav_tasks.tasks.events import SubmissionRefused


class GuidedItemRequest(CommandRequest):
    """A request by mission item, answered with a MISSION_ACK."""

    @property
    def is_go_to(self) -> bool:
        """True: the item is always a "go to"."""
        return True

    def answer(self, result: MavResult, result_param2: int = 0) -> None:
        """Send the MISSION_ACK of an accepted item; ``refuse`` sends all others."""
        if result is MavResult.ACCEPTED:
            self._ack(MavMissionResult.ACCEPTED, result_param2)

    def refuse(
        self, refusal: Rejection, *, now: float, result: MavResult | None = None
    ) -> SubmissionRefused:
        """Answer with the result and a text; return the event for the audit log."""
        self._ack(result_of(refusal))
        return super().refuse(refusal, result=result, now=now)

    def _ack(self, result: MavMissionResult, opaque_id: int = 0) -> None:
        ack = m.MissionAck(*self.packet.source, result, MavMissionType.MISSION, opaque_id)
        self.client.outlet.send(ack, self.answering)
