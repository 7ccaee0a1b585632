"""What clients send past the server to vehicles, and what of it ends here.

What the server does not claim goes to the link on which the target was seen, if it may.
"""

from mav_tasks.engine.gcs_client import GcsClient
from mav_tasks.engine.inputs import Peer
from mav_tasks.engine.motion_gate import may_pass, passed, withheld
from mav_tasks.engine.vehicle import Vehicle
from mav_tasks.engine.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services import file_transfer

EVERYBODY = Address(0, 0)
SETUP_SIGNING = 256
#: never passed on: no client may change a vehicle's keys
CLAIMED = frozenset({SETUP_SIGNING})


class Passing:
    """Passes clients' packets on."""

    def __init__(self, vehicles: VehicleSide) -> None:
        self._vehicles = vehicles

    def pass_on(
        self, client: GcsClient, packet: Packet, message: m.Message | None, *, now: float
    ) -> None:
        """Pass a packet to the vehicles that it is for; what is for us ends here."""
        if packet.message_id in CLAIMED:
            return
        target = EVERYBODY if message is None else _target(message)
        behind: dict[tuple[str, Peer], list[Vehicle]] = {}  # one endpoint, a radio with several
        for vehicle in self._vehicles.addressed_by(target.system_id):
            if target != vehicle.server_address:
                behind.setdefault(vehicle.requests.place, []).append(vehicle)
            elif isinstance(message, m.FileTransferProtocol):
                refusal = file_transfer.refusal(message, to=packet.source)
                if refusal is not None:
                    client.outlet.send(refusal, vehicle.server_address)
        for vehicles in behind.values():
            if all(may_pass(vehicle, client.key, message) for vehicle in vehicles):
                for vehicle in vehicles:
                    passed(vehicle, message, now=now)
                vehicles[0].requests.forward(packet)
            else:
                for vehicle in vehicles:
                    withheld(vehicle, client.key, message, now=now)

    def end(self, link: str, peer: Peer, *, now: float) -> None:
        """A client is gone: whatever it was driving is driven by nobody."""
        for vehicle in self._vehicles:
            if vehicle.has_granted((link, peer)):
                self._vehicles.touch(vehicle)
                vehicle.client_is_gone((link, peer), now=now)


def _target(message: m.Message) -> Address:
    """Give whom a message is for, 0 for all."""
    if isinstance(message, m.ManualControl):  # its field has a name of its own
        return Address(message.target, 0)
    return target_of(message)
