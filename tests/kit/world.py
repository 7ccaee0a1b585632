"""The virtual world of the scenarios: server, rovers and clients on one net, always observed."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import degrees, hypot, nan, radians, remainder
from pathlib import Path
from typing import Any, TypeVar

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import Outgoing
from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet
from mav_tasks.links.policy import LinkPolicy
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import CommandInt
from mav_tasks.mavlink.signing import Key
from mav_tasks.recording.decisions import Decisions
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK, InMemoryServer
from mav_tasks.store import Store
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task, TaskId
from rover_sim.body import Body, BodyState, Pose
from rover_sim.faults import Faults
from rover_sim.frames import Frame
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from rover_sim.realism import Realism
from rover_sim.vehicle import Vehicle, make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld
from tests.kit.client import ACK, REQUEST, FakeClient, TaskStatus
from tests.kit.mission import Item, Upload
from tests.kit.observer import ARDUPILOT_WAYS, PX4_WAYS, Observer, Ways
from tests.kit.store import LateStore

E = TypeVar("E")

LOOK = 0.02  # s of virtual time between two checks of a condition
PX4_HOLD = 5  # of COM_OBL_RC_ACT
STANDS = 0.01  # m/s and rad/s
COMMAND_ID = slice(10 + 28, 10 + 30)  # of a COMMAND_LONG packet


INT_COMMAND, MODE_COMMAND = 75, 76  # COMMAND_INT, COMMAND_LONG
SET_HOME = 179
SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED
HEADER = 10  # bytes
MEASURED = (30, 32)  # ATTITUDE, LOCAL_POSITION_NED
REMEMBERED = 10_000  # of MEASURED messages: 20 s of ten rovers

PROMPT = ARDUPILOT  # the rover of most scenarios


#: a rover that knows its place and heading as real ones do ends within
OFF, OFF_WAY, OFF_HEADING = 0.1, 0.035, 3.0  # m, share of its way, degrees

SETTINGS_SPEED = 0.5  # m/s, Driving.speed, also of tasks without a speed


def kinematic_body(start: Pose) -> Body:
    """Return the default body of scenarios: it slips a little, like a skid-steered one."""
    return KinematicBody(start=start, slip=0.1, seed=None)


def twin_of(
    number: int, *, start: Pose, now: float, persona: Persona = PROMPT, is_same: bool = False
) -> Vehicle:
    """Return another vehicle with the same system id but another unique id, unless ``is_same``."""
    uid = number if is_same else 99
    body = kinematic_body(start)
    return make_vehicle(body, system_id=number, now=now, persona=persona, uid=uid)


def preset(vehicle: Vehicle, persona: Persona) -> None:
    """Set the parameters of the scenarios on a rover."""
    if "COM_OBL_RC_ACT" in vehicle.autopilot.parameters:
        # by default a PX4 rover drives home when setpoints stop, and the server does not
        # drive it; tests of that restore the default
        vehicle.autopilot.parameters["COM_OBL_RC_ACT"] = PX4_HOLD
    if persona.speed_parameter == PX4.speed_parameter:
        vehicle.autopilot.parameters[PX4.speed_parameter] = -1.0  # no limit by the rover
    if persona.frame is Frame.ACKERMANN and "RO_SPEED_P" in vehicle.autopilot.parameters:
        vehicle.autopilot.parameters["RO_SPEED_P"] = 0.4  # with the defaults it hardly moves
        vehicle.autopilot.parameters["RO_SPEED_I"] = 0.5
    if persona.name == ARDUPILOT.name:  # scenarios set the speeds that matter to them
        vehicle.autopilot.parameters["CRUISE_SPEED"] = SETTINGS_SPEED


def ways_of(persona: Persona) -> Ways:
    """Return the ways of a make of rover."""
    return ARDUPILOT_WAYS if persona.name == ARDUPILOT.name else PX4_WAYS


def is_ready_to_be_driven(rover: Vehicle) -> bool:
    """Return whether a rover is truly armed and in the mode in which setpoints drive it."""
    return rover.autopilot.armed and rover.autopilot.mode is Mode.GUIDED


class Outputs:
    """Collects the packets of a server, with their times."""

    def __init__(self) -> None:
        self.sent: list[tuple[float, Outgoing]] = []

    def on_input(self, item: object, *, now: float) -> None:
        """Ignore what comes in."""

    def on_output(self, packets: Iterable[Outgoing], _events: object, *, now: float) -> None:
        """Keep what goes out."""
        self.sent += [(now, packet) for packet in packets]

    def close(self) -> None:
        """Do nothing."""


class World(VirtualWorld):
    """One server, one or more rovers, and one or more clients.

    Scenarios get it from the fixture ``make_world``, which checks the observers at the end.
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        conditions: Conditions | None = None,
        settings: Settings | None = None,
        store: Store | None = None,
        rovers: int = 1,
        body: Callable[[Pose], Body] = kinematic_body,
        persona: Persona = PROMPT,
        shows_on_request: bool = True,
        records: Path | None = None,
        policies: Mapping[str, LinkPolicy] | None = None,
        keys: tuple[Key, ...] | None = None,
        wall_offset: float | None = None,
        rover_key: Key | None = None,
        realism: Realism | None = None,
        heading: float = 0.0,
        first_id: int = 1,
        more_links: tuple[str, ...] = (),
        outputs: Outputs | None = None,
    ) -> None:
        """Create a world; ``records`` is a folder for a record of each server.

        Rovers start at a ``heading`` in degrees, and have system ids from ``first_id`` on. With
        ``rover_key`` they sign, and accept only signed packets. ``more_links``: to clients, besides
        CLIENT_LINK. ``outputs`` are told what leaves. The other arguments are InMemoryServer's.
        """
        self._policies, self._keys, self._wall_offset = policies, keys, wall_offset
        self.seed = seed
        self.watched = ObservedNet(seed=seed, conditions=conditions or Conditions())
        self.watched.shows_on_request = shows_on_request
        super().__init__(self.watched)
        if isinstance(store, LateStore):
            store.clock = lambda: self.now
        self.rovers: list[Vehicle] = []
        self.rover_parties: list[RoverParty] = []
        self.observers: list[Observer] = []
        numbers = range(first_id, first_id + rovers)
        for number in numbers:
            start = Pose(east=3.0 * (number - first_id), yaw=radians(heading))
            vehicle = make_vehicle(
                body(start),
                system_id=number,
                now=0.0,
                persona=persona,
                unix_offset=wall_offset or 0.0,
                key=rover_key,
                realism=realism,
                seed=seed + number,
            )
            preset(vehicle, persona)
            link = self.net.link(f"rover{number}")
            observer = self.watched.observers[link.name] = Observer(
                number, ways_of(persona), is_ready=partial(is_ready_to_be_driven, vehicle)
            )
            self.rovers.append(vehicle)
            self.observers.append(observer)
            party = RoverParty(vehicle, link)
            self.rover_parties.append(party)
            self.join(party)
        names = tuple(f"rover{number}" for number in numbers)
        self._names, self._settings, self._outputs = names, settings, outputs
        self._more_links = [self.net.link(name) for name in more_links]
        self.watched.to_clients |= set(more_links)
        self._records = records
        self.recorders: list[Decisions] = []
        self.server = self._new_server(store, None)
        self.join(self.server)
        self.client = self.add_client("client")

    @property
    def rover(self) -> Vehicle:
        """The first rover."""
        return self.rovers[0]

    @property
    def observer(self) -> Observer:
        """The observer of the first rover."""
        return self.observers[0]

    @property
    def truth(self) -> BodyState:
        """The first rover's true state."""
        return self.rover.truth

    def mode(self) -> Mode:
        """Return the first rover's true mode."""
        return self.rover.autopilot.mode

    @property
    def is_armed(self) -> bool:
        """Whether the first rover is truly armed."""
        return self.rover.autopilot.armed

    def add_client(
        self,
        name: str,
        *,
        system_id: int = 255,
        component_id: int = 190,
        reads_dialect: bool = True,
        server: str = CLIENT_LINK,
    ) -> FakeClient:
        """Add another client, of the server with this link."""
        client = FakeClient(
            self.net,
            name,
            system_id=system_id,
            component_id=component_id,
            reads_dialect=reads_dialect,
            server=server,
        )
        self.join(client)
        return client

    def upload(
        self,
        items: Sequence[Item],
        *,
        client: FakeClient | None = None,
        kind: int = 0,
        target: tuple[int, int] = (1, 1),
    ) -> Upload:
        """Upload a plan, by default by the first client; let time pass until it is answered."""
        upload = Upload(client or self.client, items, kind=kind, target=target)
        self.until(lambda: upload.result is not None, within=15)
        return upload

    # time

    def ready(self) -> "World":
        """Wait until the server has found every rover and the client has its position."""
        self.until(self._is_ready, within=30)
        return self

    def until(self, condition: Callable[[], object], *, within: float) -> None:
        """Let time pass until the condition holds. Raise AssertionError if it does not."""
        end = self.now + within
        while not condition():
            assert self.now < end, f"not within {within} s (seed {self.seed}): {self.describe()}"
            self.run(LOOK)

    def until_state(self, task_id: int, state: TaskState, *, within: float = 30) -> None:
        """Let time pass until a task is in a state."""
        self.until(lambda: self.state(task_id)[0] is state, within=within)

    def until_faster(self, speed: float, *, within: float = 20) -> None:
        """Let time pass until the first rover truly drives faster than so many m/s."""
        self.until(lambda: self.truth.forward_speed > speed, within=within)

    def until_idle(self, *, tasks: int, within: float = 60) -> None:
        """Let time pass until all tasks are over and the rovers handed back."""
        self.until(lambda: self.is_idle(tasks=tasks), within=within)

    def suspend_server(self, seconds: float) -> None:
        """Suspend the server's machine for ``seconds``: none of its code runs."""
        self.leave(self.server)
        self.watched.is_server_away = True
        self.run(seconds)
        self.watched.is_server_away = False
        self.join(self.server)

    def end_server(self) -> None:
        """Kill the server; everything in its memory is lost."""
        self.leave(self.server)
        self.watched.is_server_away = True
        self.watched.forget_unread()

    def start_server(self, store: Store, restored: Restored) -> None:
        """Start another server on the store of an earlier one."""
        self.watched.is_server_away = False
        self.watched.forget_unread()  # packets that arrived without a server are lost
        self.server = self._new_server(store, restored)
        self.join(self.server)
        for observer in self.observers:
            observer.server_restarted()

    def end_records(self) -> list[Path]:
        """Close the records and return their paths, in the order of the servers."""
        for recorder in self.recorders:
            recorder.close()
        return [recorder.path for recorder in self.recorders]

    # actions of a person at the rover, and faults

    def operator_mode(self, mode: Mode) -> None:
        """Turn the mode switch at the first rover."""
        self.rover.autopilot.operator_mode(mode, now=self.now)

    def operator_arm(self, armed: bool) -> None:
        """Arm or disarm at the first rover."""
        self.rover.autopilot.operator_arm(armed, now=self.now)

    def replace_rover(
        self, *, switched_on: float, persona: Persona = PROMPT, is_same: bool = False
    ) -> Vehicle:
        """Replace the first rover by one with another unique id, at the same place and address.

        ``is_same``: its unique id is the same, as after new firmware. Return the new one.
        """
        there = self.truth
        start = Pose(north=there.north, east=there.east, yaw=there.yaw)
        rover = twin_of(1, start=start, now=switched_on, persona=persona, is_same=is_same)
        self.put_rover(rover, persona)
        return rover

    def put_rover(self, rover: Vehicle, persona: Persona) -> None:
        """Let this vehicle answer at the first rover's address from now on."""
        preset(rover, persona)
        self.rovers[0] = self.rover_parties[0].vehicle = rover
        self.observer.is_ready = partial(is_ready_to_be_driven, rover)

    def fault(self, faults: Faults) -> None:
        """Set faults of the first rover; ``Faults()`` clears them."""
        self.rover.autopilot.set_faults(faults)

    def passed_on(self, source: tuple[int, int]) -> set[int]:
        """Return a set that collects ids of a client's messages to rovers, from now on."""
        ids: set[int] = set()

        def look(sender: str, _target: str, data: bytes) -> bool:
            if sender == VEHICLE_LINK and (data[5], data[6]) == source:
                ids.add(int.from_bytes(data[7:10], "little"))
            return False

        self.watched.loses = look
        return ids

    def commands_passed_on(self) -> set[int]:
        """Return a set that collects the numbers of commands that go to rovers from now on."""
        numbers: set[int] = set()

        def look(sender: str, _target: str, data: bytes) -> bool:
            if sender == VEHICLE_LINK and data[7] in (INT_COMMAND, MODE_COMMAND):
                numbers.add(int.from_bytes(data[COMMAND_ID], "little"))
            return False

        self.watched.loses = look
        return numbers

    def overheard(self, is_it: Callable[[str, str, bytes], bool]) -> list[bytes]:
        """Return a list that collects packets by their source, target and bytes, from now on."""
        packets: list[bytes] = []

        def look(source: str, target: str, data: bytes) -> bool:
            if is_it(source, target, data):
                packets.append(data)
            return False

        self.watched.loses = look
        return packets

    def bring_late(self, data: bytes) -> None:
        """Deliver a packet of the server to the first rover late."""
        MemoryNet.send(self.net, VEHICLE_LINK, "rover1", data)

    def lose_acks(self) -> list[bytes]:
        """Lose the first rover's acks from now on; return a list that collects them."""
        lost: list[bytes] = []

        def loses(source: str, target: str, data: bytes) -> bool:
            if (source, target) != ("rover1", VEHICLE_LINK) or data[7] != ACK:
                return False
            lost.append(data)
            return True

        self.watched.loses = loses
        return lost

    def from_vehicle_side(self, data: bytes, *, peer: str = "stranger") -> None:
        """Deliver a datagram to the server's vehicle link."""
        self.net.send(peer, VEHICLE_LINK, data)

    # queries

    def task(self, task_id: int) -> Task:
        """Return a task in its present state."""
        return {task.id: task for task in self.tasks()}[TaskId(task_id)]

    def state(self, task_id: int) -> tuple[TaskState, TaskReason]:
        """Return a task's state and reason; UNKNOWN if there is no such task."""
        for task in self.tasks():
            if task.id == task_id:
                return task.state, task.reason
        return TaskState.UNKNOWN, TaskReason.NONE

    def shown(self, task_id: int) -> TaskStatus:
        """Return a task's status as the first client is shown it now."""
        self.client.request_status(task_id)
        self.run(0.1)
        return self.client.statuses(task_id)[-1]

    def tasks(self) -> tuple[Task, ...]:
        """Return every task of the server."""
        return self.server.engine.snapshot(now=self.now).tasks

    def states(self) -> list[TaskState]:
        """Return the state of every task of the server."""
        return [task.state for task in self.tasks()]

    def control(self) -> str:
        """Return the phase of the server's control of the first rover."""
        return self.server.engine.snapshot(now=self.now).vehicles[0].control

    def last_words(self) -> tuple[str, ...]:
        """Return the packets that the server would send if its engine failed now, by name."""
        listener = Observer()
        for each in self.server.engine.emergency_stop_packets:
            listener.sent(self.now, each.data)
        return tuple(listener.sent_since(0))

    def paused(self) -> TaskReason:
        """Return the reason why the first rover's queue is paused."""
        return self.server.engine.snapshot(now=self.now).vehicles[0].paused

    def is_idle(self, *, tasks: int) -> bool:
        """Return whether ``tasks`` tasks exist, all are over, and the rover is handed back."""
        snapshot = self.server.engine.snapshot(now=self.now)
        return (
            len(snapshot.tasks) == tasks
            and all(task.state in TERMINAL for task in snapshot.tasks)
            and all(vehicle.control == "IDLE" for vehicle in snapshot.vehicles)
        )

    def stands(self, number: int = 1) -> bool:
        """Return whether a rover truly stands."""
        truth = self.rovers[number - 1].truth
        return hypot(truth.forward_speed, truth.lateral_speed) < STANDS and (
            abs(truth.yaw_rate) < STANDS
        )

    def pose(self) -> tuple[float, float, float]:
        """Return the first rover's true north and east in metres, and heading in degrees."""
        truth = self.truth
        return truth.north, truth.east, degrees(truth.yaw)

    def events(self, kind: type[E]) -> list[E]:
        """Return the journal's events of one type, in order."""
        store = self.server.store
        kept = getattr(store, "events", None)
        assert kept is not None, f"{store} shows no events"
        return [event for event in kept if isinstance(event, kind)]

    def history(self, task_id: int) -> list[tuple[TaskState, TaskReason]]:
        """Return a task's past states, with reasons."""
        return [(e.new, e.reason) for e in self.events(TaskChanged) if e.task_id == task_id]

    def describe(self) -> str:
        """Return the state of the world in a few words, for a failing test."""
        vehicles = self.server.engine.snapshot(now=self.now).vehicles
        tasks = [(t.id, t.state.name, t.reason.name) for t in self.tasks()]
        return f"t={self.now:.2f} {vehicles} {tasks} {self.rover!r}"

    def check(self) -> None:
        """Raise AssertionError for the observers' violations."""
        for observer in self.observers:
            observer.check()

    def _new_server(self, store: Store | None, restored: Restored | None) -> InMemoryServer:
        observers: list[EngineObserver] = [] if self._outputs is None else [self._outputs]
        if self._records is not None:
            settings = self._settings or Settings()
            recorder = Decisions(
                self._records, settings, restored, now=self.now, size=100_000_000, start="world"
            )
            self.recorders.append(recorder)
            observers.append(recorder)
        return InMemoryServer(
            self.net,
            vehicles=self._names,
            settings=self._settings,
            store=store,
            restored=restored,
            observers=observers,
            policies=self._policies,
            keys=self._keys,
            wall_offset=self._wall_offset,
            others=self._more_links,
            now=self.now,
        )

    def _is_ready(self) -> bool:
        found = self.server.engine.snapshot(now=self.now).vehicles
        return len(found) == len(self.rovers) and (
            self.now > 3.0 and self.client.heard("LOCAL_POSITION_NED")
        )


class ObservedNet(MemoryNet):
    """A net that shows each rover's observer the rover's traffic."""

    def __init__(self, *, seed: int, conditions: Conditions) -> None:
        super().__init__(seed=seed, conditions=conditions)
        self.observers: dict[str, Observer] = {}
        self.is_server_away = False
        #: the links of the server, or of all gateways
        self.to_vehicles, self.to_clients = {VEHICLE_LINK}, {CLIENT_LINK}
        self._unread: list[tuple[str, str, bytes, float]] = []
        self._sent_at: dict[bytes, float] = {}  # rovers' motion reports, newest last
        #: whether rovers receive heartbeat requests; else they send heartbeats at 1 Hz only
        self.shows_on_request = True
        #: links that a busy server does not read now, with what has arrived there
        self.unread_links: dict[str, list[tuple[MemoryLink, str, bytes, float]]] = {}
        #: returns whether the server of a link serves a rover: of two gateways, one does
        self.serves: Callable[[str, str], bool] = lambda *_: True
        #: pairs of links between which nothing passes, in either direction
        self.cut: set[frozenset[str]] = set()
        #: returns whether to lose (source, target, datagram)
        self.loses: Callable[[str, str, bytes], bool] = lambda *_: False
        #: returns the pieces in which a datagram arrives at a link
        self.cut_up: Callable[[str, bytes], Iterable[bytes]] = lambda _, data: [data]
        #: called with (client, datagram, seconds since its arrival) when the server reads it
        self.on_read: Callable[[str, bytes, float], None] = lambda *_: None
        #: called with (rover, source, datagram) on its arrival
        self.on_arrival: Callable[[str, str, bytes], None] = lambda *_: None

    def send(self, source: str, target: str, data: bytes) -> None:
        """Show the server's packets to observers, then send."""
        if source in self.to_vehicles and target in self.observers:
            self.observers[target].sent(self.now, data)
        elif source in self.to_clients and f"rover{data[5]}" in self.observers:
            self.observers[f"rover{data[5]}"].answered(self.now, data)
        if source in self.observers and len(data) > HEADER and data[7] in MEASURED:
            self._sent_at.setdefault(data, self.now)
            if len(self._sent_at) > REMEMBERED:
                del self._sent_at[next(iter(self._sent_at))]
        hidden = not self.shows_on_request and asks_for_heartbeat(data)
        if hidden or self.loses(source, target, data):
            return
        if self.cut and frozenset((source, target)) in self.cut:
            return
        super().send(source, target, data)

    def arrive(self, link: MemoryLink, source: str, data: bytes) -> None:
        """Show packets that arrive at a rover or at the server."""
        if link.name in self.observers:
            self.observers[link.name].arrived(self.now, data)
            self.on_arrival(link.name, source, data)
        elif link.name in self.unread_links:
            self.unread_links[link.name].append((link, source, data, self.now))
            return
        elif link.name in self.to_vehicles or link.name in self.to_clients:
            self._unread.append((link.name, source, data, self.now))
        for piece in self.cut_up(link.name, data):
            super().arrive(link, source, piece)

    def read_again(self, name: str) -> None:
        """Let the server read a link again, with the times at which its packets arrived."""
        for link, source, data, at in self.unread_links.pop(name, []):
            self._unread.append((name, source, data, at))
            link.arrived.append((source, data))
            link.times.append(at)

    def forget_unread(self) -> None:
        """Forget packets that waited at the server."""
        self._unread.clear()
        self.unread_links.clear()

    def deliver(self) -> None:
        """Deliver, and show packets that the server reads; none while it is away."""
        super().deliver()
        if self.is_server_away:
            return
        for link, source, data, arrived in self._unread:
            if link in self.to_clients:
                self.on_read(source, data, self.now - arrived)
            for name, observer in self.observers.items():
                if not self.serves(link, name):
                    continue
                if link in self.to_clients:
                    observer.asked(self.now, data, peer=source)
                elif source == name or source not in self.observers:
                    sent_at = self._sent_at.get(data, self.now)
                    observer.heard(self.now, data, sent_at=sent_at)
        self._unread.clear()


def asks_for_heartbeat(data: bytes) -> bool:
    """Return whether a packet is a REQUEST_MESSAGE of HEARTBEAT, whose id is zero."""
    is_request = data[7] == MODE_COMMAND and data[COMMAND_ID] == REQUEST.to_bytes(2, "little")
    return is_request and not any(data[10:14])


def at(north: float, east: float) -> dict[str, Any]:
    """Return x and y of a COMMAND_INT for a place in metres from the origin."""
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    return {"x": x, "y": y}


def put_home(world: World, north: float, east: float) -> None:
    """Set home at the rover itself, as by another link: it stays, and does not follow the rover."""
    place = at(north, east)
    command = CommandInt(1, 1, 0, SET_HOME, 0, 0, 0, 0, 0, nan, place["x"], place["y"], 0)
    world.rover.autopilot.handle(command, Address(255, 190), now=world.now)


def is_at(world: World, north: float, east: float) -> bool:
    """Return whether the first rover is truly at a place."""
    return hypot(world.truth.north - north, world.truth.east - east) < OFF


def near_pose(
    actual: tuple[float, float, float],
    wanted: tuple[float, float, float],
    *,
    metres: float | None = None,
    angle: float = OFF_HEADING,
) -> bool:
    """Return whether two poses (north, east, heading in degrees) agree within tolerance.

    ``metres`` None: as far off as a real rover is that has driven there from the origin.
    """
    if metres is None:
        metres = OFF + OFF_WAY * hypot(wanted[0], wanted[1])
    apart = hypot(actual[0] - wanted[0], actual[1] - wanted[1])
    return apart <= metres and abs(remainder(actual[2] - wanted[2], 360)) <= angle
