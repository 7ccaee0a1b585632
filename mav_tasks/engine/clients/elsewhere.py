"""Passes clients' packets on to the gateways of a fleet that have the vehicles which they are for.

A client may be connected to any gateway. Its packets for a vehicle that another gateway has go
there as they came, with their signatures, on the link FLEET_LINK; there the client is one more
client, and what that gateway sends it comes back the same way. So every gateway lists the whole
fleet, and a task gets its id from the gateway that drives it.

A STOP may come while nobody has the vehicle, or while its gateway is out of reach. It is passed on
to each gateway that gets the vehicle soon after, or as long as the vehicle has not answered it.
"""

from collections import Counter
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from struct import Struct

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide, Received
from mav_tasks.engine.inputs import FLEET_LINK, FleetChanged, Outgoing, Packets, Place
from mav_tasks.engine.services.commands import command_of, is_stop
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import BROADCAST, Address
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.tasks.lifecycle import TaskReason

MOST = 4096  # clients whose number is remembered
#: s; the longest time without a holder after a gateway has failed, and what the database then takes
IN_TRANSIT = 3.0
#: s for which a STOP without an answer is kept for a vehicle that another gateway had: as long as
#: a gateway may take to be there again, and not for ever: its answer may have been lost
UNANSWERED = 60.0
MOST_STOPS = 100
NOT_PASSED_ON = "STOP waits for the fleet's database. Use the rover's own gateway or switch"

#: begin the peers of FLEET_LINK that are no clients, before a gateway's name and the number of a
#: client of ours: there goes what it sends, from there comes what it is sent. The peer of another
#: gateway's client is that gateway's name and number only
TOWARDS, BACK = "to", "from"
#: before each packet towards a gateway: when it arrived here, s, by which it counts as old there
ARRIVED = Struct(">d")
#: result and reason of a STOP that the other gateway could not store
NOT_KEPT = (MavResult.FAILED, TaskReason.STORE_UNAVAILABLE)


@dataclass(frozen=True, slots=True)
class _Stop:
    """A STOP that came at ``at``, and the vehicles that have not answered it."""

    at: float
    received: Received
    target: int | None  # system id
    owed: set[int]


class Elsewhere:
    """Which gateway has which vehicle, besides this one."""

    def __init__(self, queue: list[Outgoing], gcs: GcsSide, vehicles: VehicleSide) -> None:
        self._queue = queue
        self._gcs = gcs
        self._vehicles = vehicles
        self.is_shared = vehicles.lease.is_shared
        self._holders: Mapping[int, str] = {}
        self._had: set[int] = set()  # vehicles that other gateways have, or had
        self._stops: list[_Stop] = []  # the latest
        self._decoder = Decoder()
        self._clients: dict[int, Place] = {}  # by number
        self._numbers: dict[Place, int] = {}
        self._last = 0  # number

    def __repr__(self) -> str:
        return f"Elsewhere({self._holders}, {len(self._clients)} clients)"

    def change(self, change: FleetChanged, *, now: float) -> None:
        """Take which gateway has which vehicle now; pass on a STOP that came just before."""
        before, self._holders = self._holders, dict(change.holders)
        self._had |= self._holders.keys()
        for vehicle, gateway in change.holders:
            if before.get(vehicle) != gateway:
                for received in self.stops_of(vehicle, now=now):
                    if received.client.key[0] != FLEET_LINK:  # their own gateway passes them on
                        self._pass_on(gateway, received)

    def stops_of(self, vehicle: int, *, now: float) -> list[Received]:
        """Return the STOPs for a vehicle that nobody may have heard who has had it."""
        recent = now - IN_TRANSIT
        self._stops = [
            each for each in self._stops if each.at >= (now - UNANSWERED if each.owed else recent)
        ]
        return [
            each.received
            for each in self._stops
            if vehicle in each.owed or (each.at >= recent and each.target in (BROADCAST, vehicle))
        ]

    def stops_for(self, vehicle: int, *, now: float) -> list[Received]:
        """Return the same STOPs as for this vehicle alone: others may have been continued since."""
        found = []
        for received in self.stops_of(vehicle, now=now):
            alone = copy(received.message)
            assert is_stop(alone)
            alone.target_system = vehicle
            found.append(received._replace(message=alone, command=command_of(alone)))
        for each in self._stops:
            each.owed.discard(vehicle)  # it is ours now, and stops
        return found

    def takes(self, received: Received, *, now: float) -> bool:
        """Pass a packet on if it is for others; return whether it is for another one alone."""
        message = received.message
        if message is None:
            return False
        if is_stop(message):
            self._note_stop(received, now=now)
        if received.client.key[0] == FLEET_LINK:
            return False
        target = self._target_of(received)
        if target == BROADCAST or isinstance(message, m.Heartbeat):
            for gateway in sorted(set(self._holders.values())):
                self._pass_on(gateway, received)
            return False
        if target is None or self._vehicles.look_at(target) is not None:
            return False
        if gateway := self._holders.get(target, ""):
            self._pass_on(gateway, received)
        return bool(gateway)

    def gateway_for_any(self, client: GcsClient) -> str:
        """Return the gateway with the most rovers, for a task that our rovers cannot drive.

        Return "" if no other gateway has rovers, or if the client's gateway passed the task on.
        """
        if client.key[0] == FLEET_LINK:
            return ""
        counts = Counter(self._holders.values())
        return max(sorted(counts), key=lambda name: counts[name], default="")

    def pass_to(
        self,
        gateway: str,
        client: GcsClient,
        packet: Packet,
        *,
        arrived: float | None = None,
        is_first: bool = False,
    ) -> None:
        """Pass a client's packet on to a gateway, which answers it; None: it is the one in hand."""
        number = self._numbers.get(client.key)
        if number is None:
            if len(self._clients) >= MOST:
                oldest = next(iter(self._clients))
                del self._numbers[self._clients.pop(oldest)]
            number = self._last = self._last + 1
            self._numbers[client.key], self._clients[number] = number, client.key
        there = TOWARDS, gateway, number
        data = ARRIVED.pack(client.arrived if arrived is None else arrived) + packet.raw
        self._queue.append(Outgoing(FLEET_LINK, there, data, is_first))

    def _target_of(self, received: Received) -> int | None:
        """Return whom a packet is for; a STOP to the server's own system is for all."""
        target: int | None = getattr(received.message, "target_system", None)
        is_ours = target == self._vehicles.our_address.system_id
        return BROADCAST if is_ours and is_stop(received.message) else target

    def bring_back(self, item: Packets) -> Packets:
        """Send our clients what other gateways have for them; return the rest: their clients'."""
        places: list[int] = []
        for place, (peer, data) in enumerate(item.datagrams):
            match peer:
                case (word, str(gateway), int(number)) if word == BACK:
                    client = self._clients.get(number)
                    if client is not None and self._gcs.client(client):
                        self._note_answer(client, data, by=gateway)
                        self._queue.append(Outgoing(*client, data))
                case _:
                    places.append(place)
        return Packets(
            item.link,
            [item.datagrams[place] for place in places],
            [item.arrived[place] for place in places] if item.arrived else (),
        )

    def _note_stop(self, received: Received, *, now: float) -> None:
        client, target = received.client, self._target_of(received)
        is_of_ours = client.key[0] != FLEET_LINK  # of others, their own gateway passes it on
        owed = {
            each
            for each in self._had
            if is_of_ours and target in (BROADCAST, each) and self._vehicles.look_at(each) is None
        }
        said = client.key, target
        kept = [each for each in self._stops if (each.received.client.key, each.target) != said]
        if len(kept) >= MOST_STOPS:  # those that nobody has to hear any more go first
            kept = sorted(kept, key=lambda each: bool(each.owed))[-MOST_STOPS + 1 :]
        self._stops = [*kept, _Stop(now, received, target, owed)]
        component = getattr(received.message, "target_component", 0)
        if owed and not self._vehicles.lease.is_trusted:
            client.answer_in_words(NOT_PASSED_ON, Address(min(owed), component), now=now)

    def _note_answer(self, client: Place, data: bytes, *, by: str) -> None:
        """Forget a client's STOPs that another gateway has answered: one answer stands for all."""
        for packet in split_datagram(data) if self._stops else ():
            if packet.message_id != m.CommandAck.id:
                continue
            ack = self._decoder.decode(packet)
            if isinstance(ack, m.CommandAck) and ack.command == MavCmd.TASK_STOP:
                if (ack.result, ack.result_param2) == NOT_KEPT:
                    continue  # its next gateway would not know it
                theirs = {each for each, gateway in self._holders.items() if gateway == by}
                for each in self._stops:
                    if each.received.client.key == client:
                        is_for_all = each.target == BROADCAST
                        each.owed.difference_update(theirs if is_for_all else {packet.system_id})

    def _pass_on(self, gateway: str, received: Received) -> None:
        client, arrived, is_first = received.client, received.arrived, is_stop(received.message)
        self.pass_to(gateway, client, received.packet, arrived=arrived, is_first=is_first)
