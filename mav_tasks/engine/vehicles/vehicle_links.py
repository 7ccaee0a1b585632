"""The links to vehicles: their endpoints, which vehicle is where, and what a link carries."""

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf

from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import LinkChanged, Outgoing, Peer, PeerChanged, Place
from mav_tasks.engine.packet_sender import Fence, PacketSender
from mav_tasks.engine.timers import Timer, Timers, Turn
from mav_tasks.engine.vehicles.link_budget import LinkBudget
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.ways import Way
from mav_tasks.latest import keep_latest
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Packer
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.heartbeat import INTERVAL
from mav_tasks.services.token_bucket import TokenBucket
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import VehicleSeen
from mav_tasks.tasks.registry import TaskRegistry

MAX_PEERS = 256  # endpoints on one vehicle link
BOTH_THERE = 1.0  # s; by then, delayed packets from the old place have come
SAYS = 10.0  # s in which a rover has said which one it is, if it ever does
MOST_SENT = 1_024  # packets that are known when they come back: seconds of ten driven rovers
NO_KEY = ", that link has no key"
REQUESTS = 4.0  # a second, to places at which a known vehicle's id is heard


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
        note_once: Callable[..., object],
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
        self._outlets: dict[Place, PacketSender] = {}  # kept, because their numbering continues
        #: the places at which a vehicle's id is heard
        self._ways: dict[tuple[int, Place], Way] = {}
        self._requests = TokenBucket(rate=REQUESTS, burst=2 * REQUESTS, now=-inf)  # to these
        self._sent: deque[Outgoing] = deque(maxlen=MOST_SENT)
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
        places = [vehicle.requests.place for vehicle in self._all.values()]
        known = [peer for link, peer in places if link == change.link]
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
            self._forget_if_empty(place)
        elif len(link.outlets) < MAX_PEERS:
            link.outlets[change.peer] = self._outlet(*place)
            for vehicle in self._all.values():
                if vehicle.requests.place == place:
                    vehicle.comes_anew()

    def has_vehicle_at(self, link: str, peer: Peer) -> bool:
        """Return whether one of our vehicles is at an endpoint."""
        return any(each.requests.place == (link, peer) for each in self._all.values())

    def owns(self, link: str) -> bool:
        """Return whether a link of this name is a vehicle link."""
        return link in self._links

    def where_sent(self, packet: Packet, place: Place) -> set[Place]:
        """Return where the server has sent this packet lately, which comes from a place now.

        Two servers with one address may send the same heartbeat: one counts only if a vehicle that
        it was sent to is heard at this place, too.
        """
        sent_to = {(sent.link, sent.peer) for sent in self._sent if sent.data == packet.raw}
        if packet.message_id == m.Heartbeat.id and place not in sent_to:
            here = {number for number, there in self._ways if there == place}
            sent_to &= {there for number, there in self._ways if number in here}
        return sent_to

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

    def forget_budgets(self) -> None:
        """Divide what each link carries anew: a vehicle came, or is at another place."""
        self._budgets.clear()

    def forget(self, vehicle: Vehicle) -> None:
        """Forget a vehicle, which this gateway does not have any more; its endpoint stays."""
        for way in [each for each in self._ways if each[0] == vehicle.system_id]:
            del self._ways[way]
        self._budgets.clear()
        self._forget_if_empty(vehicle.requests.place)

    def withdraw(self, vehicle: Vehicle) -> None:
        """Drop what waits to leave for a vehicle's endpoint, except HOLD: another one is there."""
        self._queue[:] = [
            each
            for each in self._queue
            if each.is_first or (each.link, each.peer) != vehicle.requests.place
        ]

    def may_arm(self, name: str) -> bool:
        """Return whether we may arm vehicles on a link of this name."""
        arming = self._settings.arming
        return arming == "server" or (arming == "auto" and self._links[name].is_local)

    def way(self, system_id: int, place: Place, *, now: float) -> Way:
        """Return what is known about a place at which the id of a vehicle is heard."""
        way = self._ways.get((system_id, place))
        if way is None:
            way = Way(now)
            keep_latest(self._ways, (system_id, place), way, most=MAX_PEERS)
        return way

    def moves(
        self, vehicle: Vehicle, link: str, peer: Peer, message: m.Message, *, now: float
    ) -> bool:
        """Note a message from another place than the vehicle's. Return whether it moved there.

        One with two ways moves to the better one; one that fell silent to where its id is heard.
        An id that was heard there while the vehicle was still heard is another vehicle, for good,
        unless its unique id and its clock show that it is the same. One that has restarted has
        another clock, but is not heard at the old place since.
        """
        number, old, is_heard = vehicle.system_id, vehicle.requests.place, vehicle.is_heard(now=now)
        way, used = self.way(number, (link, peer), now=now), self._ways.get((number, old))
        is_beat, was_same = isinstance(message, m.Heartbeat), way.is_same
        if was_same and now - way.heard_at > self._settings.watch.heartbeat_lost:
            way.is_same, way.first_at = None, now  # another one may be there now
        uid = "" if is_heard and not vehicle.requests.is_identified else vehicle.tasks.uid
        way.judge(message, uid, used, is_heard=is_heard, used_at=vehicle.heard_at)
        is_gone = not is_heard or self._is_gone(old)
        is_better = way.is_better_than(used, vehicle.counted_at, now=now)
        is_another = vehicle.heard_at > way.first_at + BOTH_THERE or way.is_same is False
        way.heard_at = now
        why = ""
        if self._signatures.has_key(old[0]) > self._signatures.has_key(link):
            why = NO_KEY
        elif not way.is_same and is_another and (way.is_same is False or now > way.first_at + SAYS):
            why = ". Give that one another id"
        outlets = self._links[link].outlets
        outlet = outlets.get(peer) or self._outlet(link, peer)
        if why:
            words = f"shares its id with a rover at {_named(peer)}: ignored{why}"
            self._note_once(number, words, now=now)
            vehicle.tasks.twin_heard_at = now
        elif len(outlets) < MAX_PEERS or peer in outlets:
            if is_gone or is_better if way.is_same else is_gone and is_beat and not is_another:
                outlets[peer] = outlet
                vehicle.move_to(outlet, may_arm=self.may_arm(link), is_same=bool(way.is_same))
                self._budgets.clear()
                self._ways.pop((number, old), None)
                self._forget_if_empty(old)
                self._registry.record(VehicleSeen(number, f"is now at {_named(peer)}", now))
                return True
            if way.is_same:
                outlets[peer] = outlet
            if way.is_same and not was_same:
                self._registry.record(VehicleSeen(number, f"is also heard at {_named(peer)}", now))
        is_open = is_beat and way.is_same is not False and why != NO_KEY
        if is_open and self._requests.take(now=now):
            self._beat({peer: outlet}, now=now)
            vehicle.requests.ask_there(outlet, is_same=bool(way.is_same))
        return False

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
                link, peer, self._queue, self._packer, self._signatures, self._fence, self._sent
            )
        return outlet

    def _is_gone(self, place: Place) -> bool:
        """Return whether a link is down, or its peer has disconnected: it may be back anywhere."""
        link = self._links.get(place[0])
        return link is None or place[1] not in link.outlets

    def _forget_if_empty(self, place: Place) -> None:
        """Forget a place that was left, unless a vehicle may still come back to it."""
        if self._is_gone(place) and not self.has_vehicle_at(*place):
            self._outlets.pop(place, None)


def _named(peer: Peer) -> str:
    """Return an endpoint as text: "10.0.0.2:14580"."""
    return ":".join(map(str, peer)) if isinstance(peer, tuple) else str(peer)
