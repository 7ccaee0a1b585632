"""The links to vehicles: their endpoints, which vehicle is where, and what a link carries."""

from collections import deque
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf

from mav_tasks.basics.latest import keep_latest
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import LinkChanged, Outgoing, Peer, PeerChanged, Place
from mav_tasks.engine.packets import LeaseWatch, PacketSender
from mav_tasks.engine.services.rate_budget import LinkBudget
from mav_tasks.engine.services.token_bucket import TokenBucket
from mav_tasks.engine.services.vehicle_status import INTERVAL, gcs_heartbeat
from mav_tasks.engine.timers import Timer, Timers, Turn
from mav_tasks.engine.vehicles.system_ids import NANO, Way
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import VehicleNoted, VehicleSeen
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.registry import TaskRegistry

ASKED = 64  # TIMESYNC requests, one a second and link, whose answers are still accepted
MAX_PEERS = 256  # endpoints on one vehicle link
BOTH_THERE = 1.0  # s; by then, delayed packets from the old place have come
SAYS = 10.0  # s in which a rover has said which one it is, if it ever does
MOST_SENT = 1_024  # packets that are known when they come back: seconds of ten driven rovers
MOST_NOTES = 256
NO_KEY = ", that link has no key"
REQUESTS = 4.0  # a second, to places at which a known vehicle's id is heard


@dataclass(slots=True)
class Link:
    """One vehicle link that is up."""

    is_local: bool
    capacity: float | None
    heartbeat: Timer
    outlets: dict[Peer, PacketSender]


@dataclass(repr=False, eq=False)
class VehicleLinks:
    """The vehicle links, and the endpoints at which vehicles are."""

    _queue: list[Outgoing]
    _packer: Packer
    _signatures: Signatures
    _registry: TaskRegistry
    _fleet: Fleet
    _timers: Timers
    _settings: Settings
    #: what may be sent to vehicles now
    lease: LeaseWatch

    def __post_init__(self) -> None:
        self._vehicles: dict[int, Vehicle] = {}
        #: all vehicles, read-only
        self.all = self._vehicles.values()
        #: the address under which the server speaks to vehicles
        self.our_address = _own_address(self._settings)
        self._noted: set[tuple[int, str]] = set()
        self._asked: deque[int] = deque(maxlen=ASKED)  # time stamps of our TIMESYNC requests, ns
        self._question = m.Timesync(0, 0)  # refilled for each request
        #: the vehicle links that are up, by name
        self.links: dict[str, Link] = {}
        self._outlets: dict[Place, PacketSender] = {}  # kept, because their numbering continues
        #: the places at which a vehicle's id is heard
        self._ways: dict[tuple[int, Place], Way] = {}
        self._requests = TokenBucket(rate=REQUESTS, burst=2 * REQUESTS, now=-inf)  # to these
        self._sent: deque[Outgoing] = deque(maxlen=MOST_SENT)
        #: by endpoint; cleared when a link, a setting or the place of a vehicle changes
        self._budgets: dict[Place, LinkBudget] = {}

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self.our_address = _own_address(settings)
        self._budgets.clear()

    def change_link(self, change: LinkChanged, *, now: float) -> None:
        """Add a link that came up; remove one that went down."""
        old = self.links.pop(change.link, None)
        if old is not None:
            old.heartbeat.set(inf)
        if not change.up:
            return
        self._budgets.clear()
        places = [vehicle.requests.place for vehicle in self.all]
        known = [peer for link, peer in places if link == change.link]
        outlets = {peer: self._outlet(change.link, peer) for peer in (*change.peers, *known)}
        beat = partial(self._beat, outlets)
        heartbeat = self._timers.rhythm(Turn.LINKS, beat, period=INTERVAL, now=now)
        self.links[change.link] = Link(change.is_local, change.capacity, heartbeat, outlets)

    def change_peer(self, change: PeerChanged) -> None:
        """Send to a peer that connected; one that is gone may come back at another place."""
        link, place = self.links.get(change.link), (change.link, change.peer)
        if link is None:
            return
        if not change.up:
            link.outlets.pop(change.peer, None)
            self._forget_if_empty(place)
        elif len(link.outlets) < MAX_PEERS:
            link.outlets[change.peer] = self._outlet(*place)
            for vehicle in self._at(place):
                vehicle.comes_anew()

    def has_vehicle_at(self, link: str, peer: Peer) -> bool:
        """Return whether one of our vehicles is at an endpoint."""
        return bool(self._at((link, peer)))

    def link_budget(self, vehicle: Vehicle, *, now: float) -> LinkBudget:
        """Return what the link to a vehicle carries, shared by all vehicles at its endpoint."""
        place = vehicle.requests.place
        budget = self._budgets.get(place)
        if budget is None:
            link, most = self.links.get(place[0]), self._settings.clients.telemetry_budget
            capacity, vehicles = None if link is None else link.capacity, len(self._at(place))
            budget = LinkBudget(most, capacity, vehicles=vehicles, now=now)
            self._budgets[place] = budget
        return budget

    def why_not_asked(
        self, vehicle: Vehicle, who: Hashable, packet: Packet, message: m.Message, *, now: float
    ) -> str | None:
        """Return why an observer's request is too much for a vehicle's link, or None if it fits."""
        is_driven = any(each.tasks.is_driving for each in self._at(vehicle.requests.place))
        budget = self.link_budget(vehicle, now=now)
        return budget.why_not(who, packet, message, is_driven=is_driven, now=now)

    def note_once(self, system_id: int, text: str, *, now: float) -> bool:
        """Report a text about a vehicle unless it was reported before; return whether it is new."""
        key = system_id, text
        is_new = key not in self._noted and len(self._noted) < MOST_NOTES
        if is_new:
            self._noted.add(key)
            self._registry.record(VehicleNoted(system_id, text, now))
        return is_new

    def _at(self, place: Place) -> list[Vehicle]:
        """Return our vehicles at an endpoint."""
        return [vehicle for vehicle in self.all if vehicle.requests.place == place]

    def _beat(self, outlets: Mapping[Peer, PacketSender], *, now: float) -> None:
        """Send a heartbeat and a TIMESYNC request to each endpoint of a link, each second."""
        self._question.ts1 = round(now * NANO)
        self._asked.append(self._question.ts1)
        for outlet in outlets.values():
            is_ours = self.has_vehicle_at(outlet.link, outlet.peer)
            outlet.send(gcs_heartbeat(), self.our_address, is_fenced=False, is_ours=is_ours)
            outlet.send(self._question, self.our_address, is_fenced=False, is_ours=is_ours)

    def _where_sent(self, packet: Packet, place: Place) -> set[Place]:
        """Return where the server has sent this packet lately, which comes from a place now.

        Two servers with one address may send the same heartbeat: one counts only if a vehicle that
        it was sent to is heard at this place, too.
        """
        sent_to = {(sent.link, sent.peer) for sent in self._sent if sent.data == packet.raw}
        if packet.message_id == m.Heartbeat.id and place not in sent_to:
            here = {number for number, there in self._ways if there == place}
            sent_to &= {there for number, there in self._ways if number in here}
        return sent_to

    def _meets(self, place: Place) -> PacketSender | None:
        """Return the sender to a vehicle's endpoint; None: the link is full, or down."""
        link = self.links.get(place[0])
        if link is None or (place[1] not in link.outlets and len(link.outlets) >= MAX_PEERS):
            return None
        link.outlets[place[1]] = self._outlet(*place)
        return link.outlets[place[1]]

    def _leave(self, vehicle: Vehicle) -> None:
        """Forget where a vehicle was, which this gateway does not have any more."""
        for way in [each for each in self._ways if each[0] == vehicle.system_id]:
            del self._ways[way]
        self._budgets.clear()
        self._forget_if_empty(vehicle.requests.place)

    def _may_arm(self, link: str) -> bool:
        """Return whether we may arm vehicles on a link of this name."""
        arming = self._settings.arming
        return arming == "server" or (arming == "auto" and self.links[link].is_local)

    def _way(self, system_id: int, place: Place, *, now: float) -> Way:
        """Return what is known about a place at which the id of a vehicle is heard."""
        way = self._ways.get((system_id, place))
        if way is None:
            way = Way(now)
            keep_latest(self._ways, (system_id, place), way, most=MAX_PEERS)
        return way

    def _moves(self, vehicle: Vehicle, place: Place, message: m.Message, *, now: float) -> bool:
        """Note a message from another place than the vehicle's. Return whether it moved there.

        One with two ways moves to the better one; one that fell silent to where its id is heard.
        An id that was heard there while the vehicle was still heard is another vehicle, for good,
        unless its unique id and its clock show that it is the same. One that has restarted has
        another clock, but is not heard at the old place since.
        """
        number, old, is_heard = vehicle.system_id, vehicle.requests.place, vehicle.is_heard(now=now)
        way, used = self._way(number, place, now=now), self._ways.get((number, old))
        is_beat, was_same = isinstance(message, m.Heartbeat), way.is_same
        if was_same and now - way.heard_at > self._settings.watch.heartbeat_lost:
            way.is_same, way.first_at = None, now  # another one may be there now
        uid = "" if is_heard and not vehicle.requests.is_identified else vehicle.tasks.uid
        way.judge(message, uid, used, is_heard=is_heard, used_at=vehicle.heard_at)
        is_gone = not is_heard or self._is_gone(old)
        is_better = way.is_better_than(used, vehicle.counted_at, now=now)
        is_another = vehicle.heard_at > way.first_at + BOTH_THERE or way.is_same is False
        way.heard_at = now
        link, peer = place
        why, where = "", ":".join(map(str, peer)) if isinstance(peer, tuple) else str(peer)
        if self._signatures.has_key(old[0]) > self._signatures.has_key(link):
            why = NO_KEY
        elif not way.is_same and is_another and (way.is_same is False or now > way.first_at + SAYS):
            why = ". Give that one another id"
        outlets, outlet = self.links[link].outlets, self._outlet(link, peer)
        if why:
            words = f"shares its id with a rover at {where}: ignored{why}"
            self.note_once(number, words, now=now)
            vehicle.tasks.twin_heard_at = now
        elif len(outlets) < MAX_PEERS or peer in outlets:
            moves = is_gone or is_better if way.is_same else is_gone and is_beat and not is_another
            if moves or way.is_same:
                outlets[peer] = outlet
            if moves:
                vehicle.move_to(outlet, may_arm=self._may_arm(link), is_same=bool(way.is_same))
                self._budgets.clear()
                self._ways.pop((number, old), None)
                self._forget_if_empty(old)
                self._registry.record(VehicleSeen(number, f"is now at {where}", now))
                return True
            if way.is_same and not was_same:
                self._registry.record(VehicleSeen(number, f"is also heard at {where}", now))
        is_open = is_beat and way.is_same is not False and why != NO_KEY
        if is_open and self._requests.take(now=now):
            self._beat({peer: outlet}, now=now)
            vehicle.requests.ask_there(outlet, is_same=bool(way.is_same))
        return False

    def _outlet(self, link: str, peer: Peer) -> PacketSender:
        outlet = self._outlets.get((link, peer))
        if outlet is None:
            outlet = self._outlets[link, peer] = PacketSender(
                link, peer, self._queue, self._packer, self._signatures, self.lease, self._sent
            )
        return outlet

    def _is_gone(self, place: Place) -> bool:
        """Return whether a link is down, or its peer has disconnected: it may be back anywhere."""
        link = self.links.get(place[0])
        return link is None or place[1] not in link.outlets

    def _forget_if_empty(self, place: Place) -> None:
        """Forget a place that was left, unless a vehicle may still come back to it."""
        if self._is_gone(place) and not self._at(place):
            self._outlets.pop(place, None)


def _own_address(settings: Settings) -> Address:
    return Address(settings.identity.system_id, settings.identity.component_id)
