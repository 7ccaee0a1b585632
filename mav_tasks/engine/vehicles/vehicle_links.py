"""The links to vehicles: their endpoints, which vehicle is where, and what a link carries."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf

from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import LinkChanged, Outgoing, Peer, PeerChanged
from mav_tasks.engine.packet_sender import Fence, PacketSender
from mav_tasks.engine.timers import Timer, Timers, Turn
from mav_tasks.engine.vehicles.link_budget import LinkBudget
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Packer
from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.router import Place, Router
from mav_tasks.services.heartbeat import INTERVAL
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import VehicleSeen
from mav_tasks.tasks.registry import TaskRegistry

MAX_PEERS = 256  # endpoints on one vehicle link
BOTH_THERE = 1.0  # s; by then, delayed packets from the old place have come


@dataclass(slots=True)
class Link:
    """One vehicle link that is up."""

    is_local: bool
    capacity: float | None
    heartbeat: Timer
    outlets: dict[Peer, PacketSender]


class VehicleLinks:
    """The vehicle links, and the endpoints at which vehicles are."""

    def __init__(
        self,
        vehicles: Mapping[int, Vehicle],
        *,
        queue: list[Outgoing],
        packer: Packer,
        signatures: Signatures,
        fence: Fence,
        settings: Settings,
        registry: TaskRegistry,
        timers: Timers,
        beat: Callable[..., None],
        note_once: Callable[..., None],
    ) -> None:
        """``vehicles`` has all vehicles by system id; ``note_once`` reports a text about one, once.

        ``beat`` is called with the senders of a link when a heartbeat is due on it.
        """
        self._timers = timers
        self._beat = beat
        self._all = vehicles
        self._queue = queue
        self._packer = packer
        self._signatures = signatures
        self._fence = fence
        self._settings = settings
        self._registry = registry
        self._note_once = note_once
        self._links: dict[str, Link] = {}
        #: the place of each vehicle
        self.router = Router()
        self._outlets: dict[Place, PacketSender] = {}  # kept, because their numbering continues
        #: when the first heartbeat of a known vehicle's id came from another place
        self._rivals: dict[tuple[int, str, Peer], float] = {}
        #: places whose peer has disconnected: it may be back at once, anywhere
        self._left: set[Place] = set()
        #: by endpoint; cleared when a link, a setting or the place of a vehicle changes
        self._budgets: dict[Place, LinkBudget] = {}

    def __repr__(self) -> str:
        return f"VehicleLinks({list(self._links)})"

    def __iter__(self) -> Iterator[Link]:
        """Iterate over all links."""
        return iter(self._links.values())

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self._budgets.clear()

    def change_link(self, change: LinkChanged, *, now: float) -> None:
        """Add a link that came up; remove one that went down."""
        old = self._links.pop(change.link, None)
        if old is not None:
            old.heartbeat.set(inf)
        if not change.up:
            return
        self._budgets.clear()
        places = [self.router.place_of(vehicle.system_id) for vehicle in self._all.values()]
        known = [place[1] for place in places if place is not None and place[0] == change.link]
        outlets = {peer: self._outlet(change.link, peer) for peer in (*change.peers, *known)}
        beat = partial(self._beat, outlets)
        heartbeat = self._timers.rhythm(Turn.LINKS, beat, period=INTERVAL, now=now)
        self._links[change.link] = Link(change.is_local, change.capacity, heartbeat, outlets)

    def change_peer(self, change: PeerChanged) -> None:
        """Send to a peer that connected; one that is gone may come back at another place."""
        link, place = self._links.get(change.link), (change.link, change.peer)
        if link is None:
            return
        if not change.up:
            link.outlets.pop(change.peer, None)
            self._left.add(place)
            self._forget_if_empty(place)
        elif len(link.outlets) < MAX_PEERS:
            self._left.discard(place)
            link.outlets[change.peer] = self._outlet(*place)
            for vehicle in self._all.values():
                if self.router.place_of(vehicle.system_id) == place:
                    vehicle.comes_anew()

    def has_vehicle_at(self, link: str, peer: Peer) -> bool:
        """Return whether one of our vehicles is at an endpoint."""
        return any(self.router.place_of(each) == (link, peer) for each in self._all)

    def owns(self, link: str) -> bool:
        """Return whether a link of this name is a vehicle link."""
        return link in self._links

    def meets(self, link_name: str, peer: Peer) -> tuple[PacketSender, bool] | None:
        """Return the sender to a vehicle's endpoint, and whether it is new; None: full, or down."""
        link = self._links.get(link_name)
        if link is None:
            return None
        if outlet := link.outlets.get(peer):
            return outlet, False
        if len(link.outlets) >= MAX_PEERS:
            return None
        link.outlets[peer] = self._outlet(link_name, peer)
        return link.outlets[peer], True

    def learn(self, system_id: int, place: Place) -> None:
        """Note that a vehicle is at a place."""
        self.router.learn(system_id, place)
        self._budgets.clear()

    def forget(self, system_id: int) -> None:
        """Forget a vehicle, which this gateway does not have any more; its endpoint stays."""
        place = self.router.place_of(system_id)
        self.router.forget(system_id)
        for rival in [each for each in self._rivals if each[0] == system_id]:
            del self._rivals[rival]
        self._budgets.clear()
        self._forget_if_empty(place)

    def withdraw(self, system_id: int) -> None:
        """Drop what waits to leave for a vehicle's endpoint, except HOLD: another one is there."""
        place = self.router.place_of(system_id)
        self._queue[:] = [
            each for each in self._queue if each.is_first or (each.link, each.peer) != place
        ]

    def may_arm(self, name: str) -> bool:
        """Return whether we may arm vehicles on a link of this name."""
        arming = self._settings.arming
        return arming == "server" or (arming == "auto" and self._links[name].is_local)

    def moves(self, vehicle: Vehicle, link: str, peer: Peer, *, now: float) -> bool:
        """Move a vehicle that fell silent to the place of this heartbeat. Return whether it moved.

        An id that was heard there while the vehicle was still heard is another vehicle, for good.
        """
        rival = vehicle.system_id, link, peer
        if rival not in self._rivals and len(self._rivals) >= MAX_PEERS:
            del self._rivals[next(iter(self._rivals))]
        is_another = vehicle.heard_at > self._rivals.setdefault(rival, now) + BOTH_THERE
        old = self.router.place_of(vehicle.system_id)
        if old is not None and self._signatures.has_key(old[0]) > self._signatures.has_key(link):
            words = f"shares its id with a rover at {_named(peer)}: ignored, that link has no key"
            self._note_once(vehicle.system_id, words, now=now)
            return False
        if is_another or (old not in self._left and vehicle.is_heard(now=now)):
            words = (
                f"shares its id with a rover at {_named(peer)}: ignored. Give that one another id"
            )
            self._note_once(vehicle.system_id, words, now=now)
            vehicle.tasks.twin_heard_at = now
            return False
        outlets, may_arm = self._links[link].outlets, self.may_arm(link)
        if peer not in outlets and len(outlets) >= MAX_PEERS:
            return False
        del self._rivals[rival]
        vehicle.move_to(outlets.setdefault(peer, self._outlet(link, peer)), may_arm=may_arm)
        self.learn(vehicle.system_id, (link, peer))
        self._forget_if_empty(old)
        self._registry.record(VehicleSeen(vehicle.system_id, f"is now at {_named(peer)}", now))
        return True

    def link_budget(self, vehicle: Vehicle, *, now: float) -> LinkBudget:
        """Return what the link to a vehicle carries, shared by all vehicles at its endpoint."""
        place = vehicle.requests.place
        budget = self._budgets.get(place)
        if budget is None:
            link = self._links.get(place[0])
            budget = self._budgets[place] = LinkBudget(
                budget=self._settings.clients.telemetry_budget,
                capacity=None if link is None else link.capacity,
                vehicles=sum(each.requests.place == place for each in self._all.values()),
                now=now,
            )
        return budget

    def why_not_asked(
        self, vehicle: Vehicle, who: Hashable, packet: Packet, message: m.Message, *, now: float
    ) -> str | None:
        """Return why an observer's request is too much for a vehicle's link, or None if it fits."""
        budget, place = self.link_budget(vehicle, now=now), vehicle.requests.place
        is_driven = any(v.tasks.is_driving for v in self._all.values() if v.requests.place == place)
        return budget.why_not(who, packet, message, is_driven=is_driven, now=now)

    def _outlet(self, link: str, peer: Peer) -> PacketSender:
        outlet = self._outlets.get((link, peer))
        if outlet is None:
            outlet = self._outlets[link, peer] = PacketSender(
                link, peer, self._queue, self._packer, self._signatures, self._fence
            )
        return outlet

    def _forget_if_empty(self, place: Place | None) -> None:
        """Forget a place that was left, unless a vehicle may still come back to it."""
        if place in self._left and all(
            self.router.place_of(vehicle.system_id) != place for vehicle in self._all.values()
        ):
            self._left.discard(place)
            self._outlets.pop(place, None)


def _named(peer: Peer) -> str:
    """Return an endpoint as text: "10.0.0.2:14580"."""
    return ":".join(map(str, peer)) if isinstance(peer, tuple) else str(peer)
