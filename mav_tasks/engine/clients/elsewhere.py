"""Passes clients' packets on to the gateways of a fleet that have the vehicles which they are for.

A client may be connected to any gateway. Its packets for a vehicle that another gateway has go
there as they came, with their signatures, on the link FLEET_LINK; there the client is one more
client, and what that gateway sends it comes back the same way. So every gateway lists the whole
fleet, and a task gets its id from the gateway that drives it.
"""

from collections.abc import Mapping
from typing import TypeGuard

from mav_tasks.engine.clients.gcs_side import GcsSide, Received
from mav_tasks.engine.inputs import FLEET_LINK, FleetChanged, Outgoing, Packets, Peer
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.services.command_receiver import is_stop

EVERYBODY = 0  # target_system
MOST = 4096  # clients whose number is remembered
#: s; the longest time without a holder after a gateway has failed, and what the database then takes
IN_TRANSIT = 3.0
MOST_STOPS = 100

#: begin the peers of FLEET_LINK that are no clients, before a gateway's name and the number of a
#: client of ours: there goes what it sends, from there comes what it is sent. The peer of another
#: gateway's client is that gateway's name and number only
TOWARDS, BACK = "to", "from"
LENGTH = 3


class Elsewhere:
    """Which gateway has which vehicle, besides this one."""

    def __init__(self, queue: list[Outgoing], gcs: GcsSide, vehicles: VehicleSide) -> None:
        self._queue = queue
        self._gcs = gcs
        self._vehicles = vehicles
        self.is_shared = vehicles.lease.is_shared
        self._holders: Mapping[int, str] = {}
        self._stops: list[tuple[float, Received]] = []  # the latest, and when
        self._clients: dict[int, tuple[str, Peer]] = {}  # by number
        self._numbers: dict[tuple[str, Peer], int] = {}
        self._last = 0  # number

    def __repr__(self) -> str:
        return f"Elsewhere({self._holders}, {len(self._clients)} clients)"

    def change(self, change: FleetChanged, *, now: float) -> None:
        """Take which gateway has which vehicle now; pass on a STOP that came just before."""
        before, self._holders = self._holders, dict(change.holders)
        for vehicle, gateway in change.holders:
            if before.get(vehicle) != gateway:
                for received in self.stops_of(vehicle, now=now):
                    if received.client.key[0] != FLEET_LINK:  # their own gateway passes them on
                        self._pass_on(gateway, received)

    def stops_of(self, vehicle: int, *, now: float) -> list[Received]:
        """Return the STOPs for a vehicle that came just now, when nobody may have had it."""
        self._stops = [(at, each) for at, each in self._stops if now - at <= IN_TRANSIT]
        return [each for _, each in self._stops if self._target_of(each) in (EVERYBODY, vehicle)]

    def takes(self, received: Received, *, now: float) -> bool:
        """Pass a packet on if it is for others; return whether it is for another one alone."""
        message = received.message
        if not self.is_shared or message is None:
            return False
        if is_stop(message):
            self._stops = [*self._stops[-MOST_STOPS:], (now, received)]
        if received.client.key[0] == FLEET_LINK:
            return False
        target = self._target_of(received)
        if target == EVERYBODY or isinstance(message, m.Heartbeat):
            for gateway in sorted(set(self._holders.values())):
                self._pass_on(gateway, received)
            return False
        if target is None or self._vehicles.look_at(target) is not None:
            return False
        gateway = self._holders.get(target, "")
        if gateway:
            self._pass_on(gateway, received)
        return bool(gateway)

    def _target_of(self, received: Received) -> int | None:
        """Return whom a packet is for; a STOP to the server's own system is for all."""
        target: int | None = getattr(received.message, "target_system", None)
        is_ours = target == self._vehicles.our_address.system_id
        return EVERYBODY if is_ours and is_stop(received.message) else target

    def bring_back(self, item: Packets) -> Packets:
        """Send our clients what other gateways have for them; return the rest: their clients'."""
        places = [place for place, (peer, _) in enumerate(item.datagrams) if not _is_back(peer)]
        for peer, data in item.datagrams:
            if _is_back(peer):
                client = self._clients.get(peer[-1])
                if client is not None and self._gcs.has(*client):
                    self._queue.append(Outgoing(*client, data))
        return Packets(
            item.link,
            [item.datagrams[place] for place in places],
            [item.waited[place] for place in places] if item.waited else (),
        )

    def _pass_on(self, gateway: str, received: Received) -> None:
        key = received.client.key
        number = self._numbers.get(key)
        if number is None:
            if len(self._clients) >= MOST:
                oldest = next(iter(self._clients))
                del self._numbers[self._clients.pop(oldest)]
            number = self._last = self._last + 1
            self._numbers[key], self._clients[number] = number, key
        is_first = is_stop(received.message)
        there = TOWARDS, gateway, number
        self._queue.append(Outgoing(FLEET_LINK, there, received.packet.raw, is_first))


def _is_back(peer: Peer) -> TypeGuard[tuple[str, str, int]]:
    return isinstance(peer, tuple) and len(peer) == LENGTH and peer[0] == BACK
