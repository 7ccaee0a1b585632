"""Many rovers on many links: each has its own tasks, and what befalls one is no other's business."""

import struct
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from math import cos, radians, sin
from random import Random
from typing import Any, NamedTuple, Protocol

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.engine.inputs import LinkChanged, LinkSide, Outgoing
from mav_tasks.in_memory import CLIENT_LINK, InMemoryServer
from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet
from mav_tasks.runner import link_changed
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import (
    Event,
    ServerStopped,
    TaskChanged,
    TaskSubmitted,
    VehicleNoted,
    VehicleSeen,
)
from mav_tasks.tasks.lifecycle import TERMINAL
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Move, Rotate, Task
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle, make_vehicle
from rover_sim.virtual import VirtualWorld
from tests.kit.client import (
    ACCEPTED,
    ARM,
    DENIED,
    FAILED,
    GUIDED,
    MOVE,
    REPEATS,
    REQUEST,
    ROTATE,
    TASK_QUEUE_STATUS,
    TASK_STATUS,
    TEMPORARILY_REJECTED,
    FakeClient,
    Sent,
    TaskStatus,
    setpoint,
)
from tests.kit.observer import Observer
from tests.kit.world import (
    PROMPT,
    ObservedNet,
    World,
    is_ready_to_be_driven,
    kinematic_body,
    near_pose,
)

CANCEL, MODIFY = 54010, 54012
DEADLINE = 3
HEARTBEAT = 0
OFF = Faults(silent=True, deaf=True)
BRAKING = 3.5  # s, from the speeds driven here to a stand

#: link, endpoint on it, and the rovers behind that: more than one, as behind a radio
Layout = Mapping[str, Mapping[str, tuple[int, ...]]]


# several vehicle links in one world


class FleetNet(ObservedNet):
    """A net with several vehicle links; each pair of ends has a luck of its own.

    So what one rover sends more or less does not change what becomes of another's packets.
    """

    def __init__(self, *, seed: int, conditions: Conditions) -> None:
        super().__init__(seed=seed, conditions=conditions)
        self._seed = seed
        self._usual = conditions
        self._luck: dict[tuple[str, str], Random] = {}
        self._decoder = common.MAVLink(None)
        #: the server's link that an endpoint reaches, and nothing else
        self.link_of: dict[str, str] = {}
        #: who watches the rovers behind an endpoint
        self.observers_at: dict[str, tuple[Observer, ...]] = {}
        #: s that all a rover says takes more
        self.late: dict[int, float] = {}
        #: what left the server for each endpoint
        self.towards: dict[str, list[tuple[float, bytes]]] = {}

    def send(self, source: str, target: str, data: bytes) -> None:
        """Show what the server sends, and carry it if these two ends can reach each other."""
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
        if self.link_of.get(endpoint, other) != other or self.loses(source, target, data):
            return
        self._random = self._luck.setdefault(
            (source, target), Random(f"{self._seed} {source} {target}")
        )
        more = self.late.get(data[5], 0.0) if source in self.link_of else 0.0
        usual = self._usual
        self.conditions = Conditions(
            usual.delay + more, usual.jitter, usual.loss, usual.duplication
        )
        MemoryNet.send(self, source, target, data)

    def arrive(self, link: MemoryLink, source: str, data: bytes) -> None:
        """Show what arrives at a rover or at the server."""
        for observer in self._meant(link.name, data):
            observer.arrived(self.now, data)
        if link.name.startswith("server:"):
            self._unread.append((link.name, source, data))
        MemoryNet.arrive(self, link, source, data)

    def deliver(self) -> None:
        """Deliver, and show what the server now knows."""
        MemoryNet.deliver(self)
        for link, source, data in self._unread:
            if link == CLIENT_LINK:
                for observer in self._all_observers():
                    observer.asked(self.now, data, peer=source)
            for observer in self.observers_at.get(source, ()):
                observer.heard(self.now, data)
        self._unread.clear()

    def _all_observers(self) -> list[Observer]:
        return list({id(o): o for at in self.observers_at.values() for o in at}.values())

    def _meant(self, endpoint: str, data: bytes) -> list[Observer]:
        """Give the observers of the rovers that a packet to an endpoint is for."""
        there = self.observers_at.get(endpoint, ())
        if len(there) < 2:
            return list(there)
        message = self._decoder.decode(bytearray(data))
        target = getattr(message, "target_system", 0)
        return [observer for observer in there if target in (0, observer.system_id)]


class FleetServer(InMemoryServer):
    """The server with as many vehicle links as a test wants; they may go down."""

    def up(self, link: MemoryLink, *, now: float) -> None:
        """Let a vehicle link come up."""
        link.close()  # nothing of what came before it was up is there
        self._links[link.name] = link
        self.pump.handle(link_changed(link, LinkSide.VEHICLES), now=now)
        self.pump.turn(now=now)

    def down(self, link: MemoryLink, *, now: float) -> None:
        """Let a vehicle link go down."""
        del self._links[link.name]
        self.pump.handle(LinkChanged(link.name, LinkSide.VEHICLES, up=False), now=now)
        self.pump.turn(now=now)

    def _send(self, outgoing: Outgoing) -> None:
        if outgoing.link in self._links:  # one that is down carries nothing
            super()._send(outgoing)


class Radio:
    """One endpoint, and the rovers behind it, each of which hears everything."""

    def __init__(self, link: MemoryLink, vehicles: list[Vehicle]) -> None:
        self.link = link
        self.vehicles = vehicles

    def next_deadline(self) -> float | None:
        """Give when a rover's next control step is due."""
        return min((v.next_deadline() for v in self.vehicles), default=None)

    def turn(self, *, now: float) -> None:
        """Let the rovers hear, live and speak."""
        for peer, data in self.link.receive(len(self.link.arrived)):
            for vehicle in self.vehicles:
                vehicle.receive(data, peer, now=now)
        for vehicle in self.vehicles:
            vehicle.handle_deadline(now=now)
            for to, packet in vehicle.take_packets():
                self.link.send(to, packet)


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
    ) -> None:
        self.seed = seed
        self.watched: FleetNet = FleetNet(seed=seed, conditions=conditions or Conditions())
        VirtualWorld.__init__(self, self.watched)  # World's own has but one vehicle link
        numbers = sorted(n for at in layout.values() for there in at.values() for n in there)
        assert numbers == list(range(1, len(numbers) + 1)), "rovers are numbered from 1 on"
        self.rovers = [
            make_vehicle(kinematic_body(start_of(n)), system_id=n, now=0.0, persona=PROMPT)
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
                if name in dials_in:  # the rover calls by itself: it knows where the server is
                    greeting = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
                    raw = greeting.pack(common.MAVLink(None, 250, 191))
                    self.net.send(self.links[name].name, endpoint, raw)
            self.server.up(self.links[name], now=0.0)
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
        """Let a vehicle link of the server go down."""
        self.server.down(self.links[name], now=self.now)

    def link_up(self, name: str) -> None:
        """Let it come up again."""
        self.server.up(self.links[name], now=self.now)

    def moves_house(self, number: int, *, source: str, target: str) -> None:
        """Let a rover be at another endpoint from now on."""
        vehicle = self.rovers[number - 1]
        self.radios[source].vehicles.remove(vehicle)
        self.radios[target].vehicles.append(vehicle)
        watched = self.watched.observers_at
        watched[target] = (*watched[target], self.observers[number - 1])

    def break_rover(self, number: int, faults: Faults) -> None:
        """Break something in one rover; ``Faults()`` mends it."""
        self.rovers[number - 1].autopilot.set_faults(faults)

    def pose_of(self, number: int) -> tuple[float, float, float]:
        """Give a rover's true north and east in metres, and heading in degrees."""
        truth = self.rovers[number - 1].truth
        return truth.north, truth.east, truth.yaw / radians(1)

    def queue_paused(self, number: int) -> R:
        """Give why a rover's queue stands."""
        return self.seen(number).paused

    def is_heard(self, number: int) -> bool:
        """Whether the server hears a rover."""
        return self.seen(number).heard

    def seen(self, number: int) -> Any:
        """Give what the server knows of a rover."""
        found = self.server.engine.snapshot(now=self.now).vehicles
        return next(vehicle for vehicle in found if vehicle.system_id == number)

    def sent_to(self, number: int, since: float) -> list[str]:
        """Give in words what the server has sent to a rover."""
        return self.observers[number - 1].sent_since(since)

    def journal_of(self, number: int) -> list[Event]:
        """Give all that the journal has of one rover."""
        kept: list[Event] = self.events(object)  # type: ignore[arg-type]
        return [event for event in kept if _vehicle_of(event) == number]

    def tasks_of(self, number: int) -> list[Task]:
        """Give one rover's tasks, oldest first."""
        return [task for task in self.tasks() if task.vehicle == number]


def _vehicle_of(event: Event) -> int | None:
    if isinstance(event, TaskSubmitted):
        return event.task.vehicle
    return None if isinstance(event, ServerStopped) else event.vehicle


def start_of(number: int) -> Pose:
    """Give where a rover begins: three metres from the next one, facing north."""
    return Pose(east=3.0 * (number - 1))


class MakeFleet(Protocol):
    """Makes a fleet (see Fleet) whose observers are asked at the end of the test."""

    def __call__(self, layout: Layout, **kw: Any) -> Fleet: ...


@pytest.fixture
def make_fleet() -> Iterator[MakeFleet]:
    """Give a factory of fleets that are ready to be used."""
    fleets: list[Fleet] = []

    def make(layout: Layout, **kw: Any) -> Fleet:
        fleet = Fleet(layout, **kw)
        fleets.append(fleet)
        fleet.ready()
        return fleet

    yield make
    for fleet in fleets:
        fleet.check()


TEN: Layout = {
    "own": {"a": (1,)},
    "shared": {"b": (2,), "c": (3,), "d": (4,)},
    "radio": {"e": (5, 6, 7)},
    "mixed": {"f": (8, 9), "g": (10,), "h": (11,)},
}


# each rover its own tasks


def end_of(start: Pose, tasks: list[Move | Rotate]) -> tuple[float, float, float]:
    """Give north, east and heading in degrees after tasks that end exactly where they say."""
    north, east, yaw = start.north, start.east, start.yaw
    for goal in tasks:
        if isinstance(goal, Move):
            north += goal.distance * cos(yaw)
            east += goal.distance * sin(yaw)
        else:
            yaw += goal.angle
    return north, east, yaw / radians(1)


def acked(client: FakeClient, number: int) -> list[tuple[int, int, int]]:
    """Give (command, result, id) of the acks that a client had from a rover's task server."""
    return [
        (ack.command, ack.result, ack.result_param2)
        for ack in client.acks
        if (ack.get_srcSystem(), ack.get_srcComponent()) == (number, 191)
    ]


def test_ten_rovers_on_four_links_each_do_their_own_tasks_and_no_others(
    make_fleet: MakeFleet,
) -> None:
    fleet = make_fleet(TEN)  # the eleventh has no task
    clients = fleet.client, fleet.other
    wanted: dict[int, list[Move | Rotate]] = {}
    for number in range(1, 11):  # no two rovers with the same: a wrong one ends somewhere else
        first, angle, last = 0.4 + 0.06 * number, 15.0 * number - 90, 0.3 + 0.05 * (11 - number)
        wanted[number] = [Move(first, None), Rotate(radians(angle or 5), None), Move(last, None)]
    for step in range(3):
        for number, goals in wanted.items():
            goal, client = goals[step], clients[(number + step) % 2]
            if isinstance(goal, Move):
                client.move(goal.distance, target=(number, 191))
            else:
                client.rotate(goal.angle / radians(1), target=(number, 191))
        fleet.run(0.02)
    fleet.until_idle(tasks=30, within=40)

    assert sorted(t.id for t in fleet.tasks()) == list(range(1, 31))
    assert {t.state for t in fleet.tasks()} == {S.COMPLETED}
    for number, goals in wanted.items():
        tasks = fleet.tasks_of(number)
        assert [type(t.goal) for t in tasks] == [type(goal) for goal in goals]
        assert near_pose(fleet.pose_of(number), end_of(start_of(number), goals), metres=0.03)
        of_client = [[], []] if number % 2 else [[], []]
        for step, task in enumerate(tasks):
            command = MOVE if isinstance(task.goal, Move) else ROTATE
            of_client[(number + step) % 2].append((command, ACCEPTED, task.id))
        assert [acked(client, number) for client in clients] == of_client
    assert [len(client.acks) for client in clients] == [15, 15]
    assert near_pose(fleet.pose_of(11), end_of(start_of(11), []), metres=0, angle=0)
    assert fleet.sent_to(11, 0.0).count("move") == 0
