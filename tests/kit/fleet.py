"""Many rovers on many links: links that go down, and several rovers behind one radio."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import degrees
from random import Random
from typing import cast

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import LinkChanged, LinkSide
from mav_tasks.engine.snapshot import VehicleSnapshot
from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK, InMemoryServer
from mav_tasks.tasks.events import TaskChanged, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.vehicle import Vehicle, make_vehicle
from rover_sim.virtual import VirtualWorld
from tests.kit.client import packed
from tests.kit.observer import Observer
from tests.kit.world import (
    PROMPT,
    ObservedNet,
    World,
    is_ready_to_be_driven,
    kinematic_body,
)

WORK = (75, 76, 84)  # COMMAND_INT, COMMAND_LONG, SET_POSITION_TARGET_LOCAL_NED
GOOD = Conditions()

#: link: endpoint on it: rovers behind it; several, as behind a radio
Layout = Mapping[str, Mapping[str, tuple[int, ...]]]


# several vehicle links in one world


class FleetNet(ObservedNet):
    """A net with several degraded vehicle links; the clients' link is good.

    Each pair of ends has its own random numbers, so that a rover's extra traffic does not change
    the fate of another's packets.
    """

    def __init__(self, *, seed: int, conditions: Conditions) -> None:
        super().__init__(seed=seed, conditions=conditions)
        self._seed = seed
        self._bad = conditions
        self._luck: dict[tuple[str, str], Random] = {}
        self._decoder = common.MAVLink(None)
        #: the only server link that an endpoint reaches
        self.link_of: dict[str, str] = {}
        #: links that are down
        self.down: set[str] = set()
        #: observers of the traffic at each endpoint
        self.observers_at: dict[str, tuple[Observer, ...]] = {}
        #: s, delay of all packets from a rover, by its system id
        self.late: dict[int, float] = {}
        #: packets that left the server, by endpoint
        self.towards: dict[str, list[tuple[float, bytes]]] = {}

    def send(self, source: str, target: str, data: bytes) -> None:
        """Show the server's packet to observers, and carry it if both ends can reach each other."""
        if target in self.link_of and source.startswith("server:"):
            self.towards.setdefault(target, []).append((self.now, data))
            for observer in self._meant(target, data):
                observer.sent(self.now, data)
        elif source == CLIENT_LINK:
            for observer in self._all_observers():
                if observer.system_id == data[5]:
                    observer.answered(self.now, data)
        endpoint = target if target in self.link_of else source
        other = source if target in self.link_of else target
        if self.link_of.get(endpoint, other) != other or other in self.down:
            return
        if self.loses(source, target, data):
            return
        luck = self._luck.get((source, target))
        if luck is None:
            luck = self._luck[source, target] = Random(f"{self._seed} {source} {target}")
        self._random = luck
        self.conditions = self._bad if endpoint in self.link_of else GOOD
        if data[5] in self.late and source in self.link_of:
            self.conditions = replace(self._bad, delay=self.late[data[5]])
        MemoryNet.send(self, source, target, data)

    def arrive(self, link: MemoryLink, source: str, data: bytes) -> None:
        """Show a packet that arrives at a rover or at the server."""
        if link.name in self.down:
            return
        for observer in self._meant(link.name, data):
            observer.arrived(self.now, data)
        if link.name.startswith("server:"):
            self._unread.append((link.name, source, data, self.now))
        MemoryNet.arrive(self, link, source, data)

    def deliver(self) -> None:
        """Deliver packets, and show what the server has received."""
        MemoryNet.deliver(self)
        for link, source, data, _ in self._unread:
            if link == CLIENT_LINK:
                for observer in self._all_observers():
                    observer.asked(self.now, data, peer=source)
            for observer in self.observers_at.get(source, ()):
                observer.heard(self.now, data, sent_at=self.now)
        self._unread.clear()

    def _all_observers(self) -> list[Observer]:
        return list({id(o): o for at in self.observers_at.values() for o in at}.values())

    def _meant(self, endpoint: str, data: bytes) -> list[Observer]:
        """Return the observers of the rovers that a packet at an endpoint is for."""
        there = self.observers_at.get(endpoint, ())
        if len(there) < 2:
            return list(there)
        message = self._decoder.decode(bytearray(data))
        target = getattr(message, "target_system", 0)
        return [observer for observer in there if target in (0, observer.system_id)]


class FleetServer(InMemoryServer):
    """The server with any number of vehicle links, which may go down."""

    def up(self, link: MemoryLink, *, now: float) -> None:
        """Bring a vehicle link up."""
        self._links[link.name] = link
        change = LinkChanged(link.name, LinkSide.VEHICLES, up=True, peers=link.peers, is_local=True)
        self.take_in(change, now=now)

    def down(self, link: MemoryLink, *, now: float) -> None:
        """Take a vehicle link down, and report it to the engine as its owner does."""
        self.take_in(LinkChanged(link.name, LinkSide.VEHICLES, up=False), now=now)


class Radio:
    """One endpoint with the rovers behind it, each of which receives everything."""

    def __init__(self, link: MemoryLink, vehicles: list[Vehicle]) -> None:
        self.link = link
        self.vehicles = vehicles

    def next_deadline(self) -> float | None:
        """Return when the next control step of a rover is due."""
        return min((v.next_deadline() for v in self.vehicles), default=None)

    def turn(self, *, now: float) -> None:
        """Receive, run due control steps, and send."""
        for peer, data in self.link.receive(len(self.link.arrived)):
            for vehicle in self.vehicles:
                vehicle.receive(data, peer, now=now)
        for vehicle in self.vehicles:
            vehicle.handle_deadline(now=now)
            for to, packet in vehicle.take_packets():
                self.link.send(to, packet)


class TwoRadios:
    """One rover that sends and hears everything by the radios at two endpoints."""

    def __init__(self, rover: Vehicle, one: Radio, other: Radio) -> None:
        self.rover = rover
        self.links = (one.link, other.link)

    def next_deadline(self) -> float | None:
        """Return when the rover's next control step is due."""
        return self.rover.next_deadline()

    def turn(self, *, now: float) -> None:
        """Receive, answer by the same radio, run due control steps, and send by both."""
        for link in self.links:
            for peer, data in link.receive(len(link.arrived)):
                self.rover.receive(data, (link.name, peer), now=now)
            self._send([link])
        self.rover.handle_deadline(now=now)
        self._send(self.links)

    def _send(self, links: Sequence[MemoryLink]) -> None:
        for to, packet in self.rover.take_packets():
            radio, peer = cast(tuple[str, str], to)  # as given to ``receive``
            for link in links:
                if link.name == radio:
                    link.send(peer, packet)


class Fleet(World):
    """One server, rovers 1, 2, 3 ... on several vehicle links, and two clients."""

    def __init__(
        self,
        layout: Layout,
        *,
        seed: int = 0,
        conditions: Conditions | None = None,
        settings: Settings | None = None,
        dials_in: tuple[str, ...] = (),
        second_radio: tuple[str, str] | None = None,
    ) -> None:
        """``second_radio``: the endpoint of rover 1 and another one, at which it is as well."""
        self.seed = seed
        self.watched: FleetNet = FleetNet(seed=seed, conditions=conditions or Conditions())
        VirtualWorld.__init__(self, self.watched)  # World's own has no radios
        numbers = sorted(n for at in layout.values() for there in at.values() for n in there)
        assert numbers == list(range(1, len(numbers) + 1)), "World numbers its rovers from 1 on"
        self.rovers = [
            make_vehicle(kinematic_body(start_of(n)), system_id=n, now=0.0, persona=PROMPT, seed=n)
            for n in numbers
        ]
        self.observers = [
            Observer(n, is_ready=partial(is_ready_to_be_driven, self.rovers[n - 1]))
            for n in numbers
        ]
        self.server: FleetServer = FleetServer(self.net, vehicles=(), settings=settings)
        self.join(self.server)
        self.radios: dict[str, Radio] = {}
        self.links: dict[str, MemoryLink] = {}
        for name, endpoints in layout.items():
            peers = () if name in dials_in else tuple(endpoints)
            self.links[name] = self.net.link(f"server:{name}", peers=peers)
            for endpoint, there in endpoints.items():
                self.add_radio(name, endpoint, [self.rovers[n - 1] for n in there])
                self.watched.observers_at[endpoint] = tuple(self.observers[n - 1] for n in there)
                if name in dials_in:  # the rover speaks first: it knows the server's address
                    greeting = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
                    self.net.send(self.links[name].name, endpoint, packed(greeting, 250, 191))
            self.server.up(self.links[name], now=0.0)
        if second_radio is not None:
            one, other = (self.radios[endpoint] for endpoint in second_radio)
            self.leave(one)
            self.leave(other)
            self.join(TwoRadios(self.rovers[0], one, other))
            self.watched.observers_at[second_radio[1]] = (self.observers[0],)
        self.client = self.add_client("client")
        self.other = self.add_client("other", system_id=245)

    def add_radio(self, link: str, endpoint: str, vehicles: list[Vehicle]) -> Radio:
        """Put rovers at an endpoint of a link."""
        radio = Radio(self.net.link(endpoint), vehicles)
        self.watched.link_of[endpoint] = self.links[link].name
        self.radios[endpoint] = radio
        self.join(radio)
        return radio

    def link_down(self, name: str) -> None:
        """Take a vehicle link of the server down; it carries nothing."""
        self.watched.down.add(self.links[name].name)
        self.server.down(self.links[name], now=self.now)

    def moves_house(self, number: int, *, source: str, target: str) -> None:
        """Move a rover to another endpoint."""
        vehicle = self.rovers[number - 1]
        self.radios[source].vehicles.remove(vehicle)
        self.radios[target].vehicles.append(vehicle)
        watched = self.watched.observers_at
        watched[target] = (*watched[target], self.observers[number - 1])

    def break_rover(self, number: int, faults: Faults) -> None:
        """Set the faults of one rover; ``Faults()`` clears them."""
        self.rovers[number - 1].autopilot.set_faults(faults)

    def pose_of(self, number: int) -> tuple[float, float, float]:
        """Return a rover's true north and east in metres, and heading in degrees."""
        truth = self.rovers[number - 1].truth
        return truth.north, truth.east, degrees(truth.yaw)

    def queue_paused(self, number: int) -> R:
        """Return the reason why a rover's queue is paused."""
        return self.seen(number).paused

    def is_heard(self, number: int) -> bool:
        """Return whether the server hears a rover."""
        return self.seen(number).heard

    def seen(self, number: int) -> VehicleSnapshot:
        """Return the server's state of a rover."""
        found = self.server.engine.snapshot(now=self.now).vehicles
        return next(vehicle for vehicle in found if vehicle.system_id == number)

    def sent_to(self, number: int, since: float) -> list[str]:
        """Return the server's packets to a rover, in words."""
        return self.observers[number - 1].sent_since(since)

    def journal_of(self, number: int) -> list[object]:
        """Return all events of one rover in the journal."""
        return [event for event in self.events(object) if _vehicle_of(event) == number]

    def when(self, task_id: int, state: S) -> float:
        """Return the time at which a task first entered a state."""
        changes = self.events(TaskChanged)
        return next(e.at for e in changes if (e.task_id, e.new) == (task_id, state))

    def work_at(self, endpoint: str, since: float) -> list[float]:
        """Return the times at which setpoints and commands left the server for an endpoint."""
        sent = self.watched.towards.get(endpoint, [])
        return [at for at, data in sent if at >= since and data[7] in WORK]

    def tasks_of(self, number: int) -> list[Task]:
        """Return one rover's tasks, oldest first."""
        return [task for task in self.tasks() if task.vehicle == number]


def _vehicle_of(event: object) -> int | None:
    if isinstance(event, TaskSubmitted):
        return event.task.vehicle
    vehicle: int | None = getattr(event, "vehicle", None)
    return vehicle


def start_of(number: int) -> Pose:
    """Return a rover's start: three metres apart, facing north."""
    return Pose(east=3.0 * (number - 1))
