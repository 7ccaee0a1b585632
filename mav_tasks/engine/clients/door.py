"""How many requests of each client are taken in: as many as its role may send in a second.

STOP is never too many. What belongs to a transfer that is under way is asked for, and not counted; nor is what says that
somebody is there, or drives by hand: its rate is bounded where it comes in. But all that goes on to
a rover is counted of who may only look: its way there may be narrow.
"""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR
from mav_tasks.engine.policy import row_of
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import Answer, is_stop
from mav_tasks.tasks.lifecycle import TaskReason


class Door:
    """Counts requests, and answers what is one too many."""

    def __init__(self, vehicles: VehicleSide, refusals: Refusals) -> None:
        self._refusals = refusals
        self._vehicles = vehicles
        #: requests that were too many
        self.left_out = 0

    def may_pass(
        self, client: GcsClient, packet: Packet, message: m.Message | None, *, now: float
    ) -> bool:
        """Whether a client's packet is seen to; a command is told if it is not."""
        if is_stop(message) or _is_uncounted(client, packet, message) or client.may_ask(now=now):
            return True
        self.left_out += 1
        if isinstance(message, m.CommandLong | m.CommandInt) and client.may_be_refused(now=now):
            self._refuse(client, packet, message, now=now)
        return False

    def _refuse(
        self,
        client: GcsClient,
        packet: Packet,
        message: m.CommandLong | m.CommandInt,
        *,
        now: float,
    ) -> None:
        vehicle = self._vehicles.look_at(message.target_system)
        if vehicle is None:
            return
        component = message.target_component or vehicle.server_component
        source = Address(vehicle.system_id, component)
        answer = Answer(
            message.command, MavResult.TEMPORARILY_REJECTED, TaskReason.RATE_LIMITED, source
        )
        client.answer(answer, packet.source)
        rights = client.rights
        words = f"role {rights.role} may send {rights.limits.rate:g} requests a second"
        client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)
        refusal = Rejection(TaskReason.RATE_LIMITED, words)
        self._refusals.stream(client, vehicle.system_id, packet, refusal, now=now)


def _is_uncounted(client: GcsClient, packet: Packet, message: m.Message | None) -> bool:
    row = row_of(packet.message_id, message)
    return not row.is_counted and (row.role != OBSERVER or client.rights.reach(OPERATOR))
