"""Gateways in virtual time, each with its whole engine, over one fleet and one model database."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from random import Random
from struct import Struct, unpack_from
from typing import Any

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import (
    FLEET_LINK,
    Committed,
    FleetChanged,
    IdsGranted,
    LeaseChanged,
    NonceTaken,
    Peer,
    TasksElsewhere,
    VehiclesGone,
    VehiclesTaken,
    WallClock,
)
from mav_tasks.fleet.lease import Terms
from mav_tasks.fleet.member import Change, Member, Request
from mav_tasks.fleet.standing import Effect, Standing
from mav_tasks.links.memory import MemoryLink
from mav_tasks.links.policy import LinkPolicy
from mav_tasks.mavlink.signing import Key
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK, InMemoryServer
from mav_tasks.store import Evicted, Outcome, Store
from mav_tasks.tasks.events import Event, TaskChanged, TaskModified, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.lifecycle import TERMINAL, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task
from tests.kit.gateways.database import Database
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World

TOWARDS, BACK, ARRIVED = "to", "from", Struct(">d")  # of packets between gateways
STEP, MOST_LEAD = 3.0, 50.0  # s, of the lead of signatures

STOP = 54003
SETPOINTS, COMMAND, ARM = (84, 86), 76, 400
BLOCK = 1_000  # task ids
CARRIED = 0.01  # s, for which a packet is under way between gateways
GIVEN_UP = 0.4  # s, for which an answer is awaited
PING = 0.1  # s
LOOK = 2.0  # s between two looks at other gateways' tasks, task_watch.PERIOD
SESSION_ENDS = 0.02  # s after the death of its process


def is_stop(data: bytes) -> bool:
    """Return whether a MAVLink 2 packet is a COMMAND_LONG that stops a rover."""
    return data[7:10] == b"\x4c\0\0" and data[38:40] == STOP.to_bytes(2, "little")


def moves(data: bytes) -> bool:
    """Return whether a MAVLink 2 packet moves a rover, or arms it."""
    payload = data[10 : 10 + data[1]].ljust(60, b"\0")
    kind = int.from_bytes(data[7:10], "little")
    if kind in SETPOINTS:
        forward, side = unpack_from("<2f", payload, 16)
        (turn,) = unpack_from("<f", payload, 44)
        return any((forward, side, turn))
    if kind == COMMAND:
        (command,) = unpack_from("<H", payload, 28)
        (first,) = unpack_from("<f", payload)
        return bool(command == ARM and first == 1.0)
    return False


def part_of(restored: Restored, vehicles: frozenset[int]) -> Restored:
    """Return what a store has about some vehicles."""

    def some(mapping: Any) -> Any:
        return {vehicle: value for vehicle, value in mapping.items() if vehicle in vehicles}

    plans = {key: plan for key, plan in restored.plans.items() if key[0] in vehicles}
    return replace(
        restored,
        tasks=tuple(task for task in restored.tasks if task.vehicle in vehicles),
        paused=some(restored.paused),
        uids=some(restored.uids),
        speeds=some(restored.speeds),
        halt_epochs=some(restored.halt_epochs),
        halted=some(restored.halted),
        disarmed=restored.disarmed & vehicles,
        plans=plans,
    )


class FleetLink(MemoryLink):
    """The link between gateways, as the real one is over the database: in order, with a delay."""

    def __init__(self, world: "FleetWorld", gateway: str) -> None:
        super().__init__(world.net, FLEET_LINK, (), 0)
        self._world, self._gateway = world, gateway
        self.under_way: deque[tuple[float, Peer, bytes, float]] = deque()
        self.sent = 0
        self._kept: list[tuple[Peer, bytes]] = []  # until the database is reached

    def send(self, peer: Peer, data: bytes) -> None:
        assert isinstance(peer, tuple)
        raw, arrived = data, self._world.now
        if peer[0] == TOWARDS:
            raw, (arrived,) = data[ARRIVED.size :], ARRIVED.unpack_from(data)
        if not self._is_reached():  # as the real one: a STOP waits, and the rest is lost
            if is_stop(raw):
                self._kept.append((peer, data))
            return
        self.sent += 1
        if peer[0] == TOWARDS:
            _, there, number = peer
            origin: Peer = (self._gateway, number)
        else:
            there, number = peer
            origin = (BACK, self._gateway, number)
        other = self._world.gateways.get(there)
        if other is not None and not other.is_dead:
            other.mail.under_way.append((self._world.now + CARRIED, origin, raw, arrived))

    def next_arrival(self) -> float | None:
        if not self._is_reached():
            return None
        return self._world.now if self._kept else self.under_way[0][0] if self.under_way else None

    def deliver(self, now: float) -> None:
        if not self._is_reached():
            stops = [each for each in self.under_way if is_stop(each[2])]
            self.under_way = deque(stops)
            return
        kept, self._kept = self._kept, []
        for peer, data in kept:
            self.send(peer, data)
        while self.under_way and self.under_way[0][0] <= now:
            _, peer, data, arrived = self.under_way.popleft()
            if isinstance(peer, tuple) and peer[0] != BACK:
                self._world.passes_on(self._gateway, data, arrived)
            self.arrived.append((peer, data))
            self.times.append(arrived)

    def _is_reached(self) -> bool:
        own = self._world.gateways.get(self._gateway)
        return own is None or own.is_reached


class SharedStore:
    """What all gateways have stored, in the order of their commits."""

    def __init__(self, path: Path) -> None:
        #: UTC less virtual time, by the clock of the gateway that writes or reads
        self.offset = 0.0
        self.store = PromptSqliteStore(path, wall_offset=lambda: self.offset)
        self._next_id = 1
        self._read: tuple[int, tuple[Task, ...]] = 0, ()  # events, and the tasks by them
        #: called when something was stored that other gateways are notified of
        self.notify: Callable[[], None] = lambda: None
        self.leads: dict[int, float] = {}
        #: of tasks for any rover
        self.nonces: dict[tuple[str, int, int, int], Task] = {}

    def block(self) -> IdsGranted:
        """Return the next ids."""
        first, self._next_id = self._next_id, self._next_id + BLOCK
        return IdsGranted(first, BLOCK)

    def next_lead(self, vehicles: frozenset[int]) -> float:
        """Return the next lead of signatures, as fleet_loader does, without the decay."""
        for vehicle in vehicles:
            self.leads[vehicle] = min(MOST_LEAD, self.leads.get(vehicle, 0.0) + STEP)
        return max(self.leads[vehicle] for vehicle in vehicles)

    def keep(self, events: Sequence[Event], *, offset: float = 0.0) -> list[NonceTaken]:
        """Make events durable; refuse tasks for any rover whose nonce others have."""
        self.offset = offset
        taken = [
            found
            for event in events
            if isinstance(event, TaskSubmitted) and (found := self._claim(event.task)) is not None
        ]
        refused = {each.task_id for each in taken}
        self.store.append(
            [e for e in events if not (isinstance(e, TaskSubmitted) and e.task.id in refused)]
        )
        self.store.take_outcomes()
        if any(map(_is_news, events)):
            self.notify()
        return taken

    def _claim(self, task: Task) -> NonceTaken | None:
        if not (task.choice and task.marks.nonce):
            return None
        who = task.submitter
        key = who.key, who.system_id, who.component_id, task.marks.nonce
        first = self.nonces.setdefault(key, task)
        if first is task or not any(each.id == first.id for each in self.tasks()):
            self.nonces[key] = task
            return None
        return NonceTaken(task.id, first.id, first.marks.payload)

    def part(self, vehicles: frozenset[int], *, offset: float = 0.0) -> Restored:
        """Return what is stored about some vehicles."""
        self.offset = offset
        return part_of(self.store.load(), vehicles)

    def tasks(self) -> tuple[Task, ...]:
        """Return all stored tasks."""
        stored = len(self.store.events)
        if stored != self._read[0]:
            self.offset = 0.0
            self._read = stored, self.store.load().tasks
        return self._read[1]


def _is_news(event: Event) -> bool:
    match event:
        case TaskChanged(new=new):
            return new in TERMINAL
        case TaskSubmitted(task=task):
            return task.terms.after > 0
        case TaskModified() | TaskWithdrawn():
            return True
        case _:
            return False


class GatewayStore:
    """The store of one gateway in one epoch; ``is_current`` is the database's fence.

    None: there is no lease yet, under which the real store begins.
    """

    name = place = "shared"

    def __init__(
        self,
        shared: SharedStore,
        is_current: Callable[[], bool | None],
        gateway: str,
        offset: Callable[[], float],
    ) -> None:
        self._shared = shared
        self._is_current = is_current
        self._gateway = gateway
        self._offset = offset
        self._count = 0
        self._outcomes: list[Outcome] = []
        self.events: list[Event] = []
        #: whether the database is reached; events wait meanwhile
        self.is_reached = True
        self._waiting: list[Event] = []

    def load(self) -> Restored:
        return Restored(gateway=self._gateway)

    def journal(self) -> Iterator[tuple[int, Event]]:
        yield from enumerate(self.events, 1)

    def append(self, events: Sequence[Event]) -> None:
        self._waiting += events

    def take_outcomes(self) -> list[Outcome]:
        is_current = self._is_current()
        if self.is_reached and self._waiting and is_current is not None:
            if is_current:
                self._outcomes += self._shared.keep(self._waiting, offset=self._offset())
                self.events += self._waiting
                self._count += len(self._waiting)
                self._outcomes.append(Committed(self._count))
            else:
                self._outcomes.append(Evicted("evicted"))
            self._waiting = []
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def load_vehicles(self, vehicles: frozenset[int]) -> None:
        """Answer in ``take_outcomes``."""
        lead = self._shared.next_lead(vehicles)
        part = self._shared.part(vehicles, offset=self._offset())
        restored = replace(part, signing_lead=lead)
        self._outcomes.append(VehiclesTaken(tuple(sorted(vehicles)), restored))

    def grant_ids(self) -> None:
        """Answer in ``take_outcomes``."""
        self._outcomes.append(self._shared.block())

    def fileno(self) -> None:
        return None

    def close(self) -> None:
        pass


class Gateway:
    """One process: its member, its engine, and its way to the model database."""

    def __init__(self, world: "FleetWorld", name: str) -> None:
        self.world, self.name = world, name
        self.member = Member(name, Terms())
        self.session: int | None = None
        self._latest: int | None = None  # session; it may be over
        self.effects: list[Effect] = []
        self.got: list[tuple[float, int]] = []
        self.let_go: list[tuple[float, int]] = []  # when the engine forgot each vehicle
        self.is_reached = True  # the database
        self.hears = True  # the database's answers
        self.is_pinged = True  # by the others, and they by it
        self.is_looking = True  # at other gateways' tasks
        self.is_frozen = False
        self.is_dead = False
        #: when, when it is answered or given up, and whether the answer comes in time
        self._asked: tuple[Request, float, float, bool] | None = None
        self._ping_at = 0.0
        self._begin()

    def _begin(self) -> None:
        """Begin with an engine that has no vehicle."""
        self.store = GatewayStore(self.world.shared, self._is_current, self.name, self._offset)
        self.mail = FleetLink(self.world, self.name)
        self._told: tuple[tuple[int, str], ...] = ()
        self._expected: frozenset[int] = frozenset()
        self._seen: dict[int, TaskState | None] = {}
        self._look_at = inf
        self.server = InMemoryServer(
            self.world.net,
            vehicles=self.world.rover_names,
            settings=self.world.settings,
            store=self.store,
            restored=self.store.load(),
            name=self.name,
            others=(self.mail,),
            wall_offset=None if self.world.wall_offset is None else self._offset(),
            policies=self.world.policies_of(self.name),
            keys=self.world.keys,
            now=self.world.now,
        )
        self.store.grant_ids()

    def _drop(self) -> None:
        """Begin with a new engine; requests that have no answer yet are lost."""
        self._begin()
        self.world.dropped(self.name)

    def __repr__(self) -> str:
        return f"Gateway({self.name}, {self.member.lease})"

    def set_clock(self, error: float) -> None:
        """Set the wall clock of its machine, so many seconds ahead of the true time."""
        self.world.clock_errors[self.name] = error
        self.server.take_in(WallClock(self._offset()), now=self.world.now)

    def _offset(self) -> float:
        return (self.world.wall_offset or 0.0) + self.world.clock_errors.get(self.name, 0.0)

    @property
    def engine(self) -> Any:
        return self.server.engine

    @property
    def pump(self) -> Any:
        return self.server.pump

    def next_deadline(self) -> float:
        if self.is_frozen:
            return self.world.now + 10.0
        own = self.server.next_deadline()
        mail = self.mail.next_arrival()
        due = [] if mail is None else [mail]
        due += [
            self._look_at,
            self._ping_at,
            self.member.next_turn if self._asked is None else self._asked[2],
        ]
        lease = self.member.lease.next_deadline()
        return max(self.world.now, min([*due, *(at for at in (own, lease) if at is not None)]))

    def turn(self, *, now: float) -> None:
        if self.is_frozen:
            return
        self._tell(Change(tuple(self.member.lease.passed(now))), now=now)
        if now >= self._ping_at:
            self._ping_at = now + PING
            self._ping(now)
        self._talk(now)
        holders = tuple(sorted(self.member.rivals.holders().items()))
        if holders != self._told:
            self._told = holders
            self.server.take_in(FleetChanged(holders), now=now)
        self.mail.deliver(now)
        self.server.turn(now=now)
        if self.pump.is_evicted:
            self._drop()
        self._watch_tasks(now)

    def notified(self) -> None:
        """Look at other gateways' tasks soon."""
        if self._expected:
            self._look_at = min(self._look_at, self.world.now + self.world.delay())

    def _watch_tasks(self, now: float) -> None:
        """Do as task_watch does."""
        expected = self.engine.expected
        if expected is not self._expected:
            self._expected, self._seen = expected, {}
            self._look_at = now + self.world.delay() if expected else inf
        if now < self._look_at:
            return
        self._look_at = now + LOOK
        if not (self.is_reached and self.is_looking and self.world.database.is_up):
            return
        states = {int(task.id): task.state for task in self.world.shared.tasks()}
        seen = {each: states.get(each) for each in sorted(expected)}
        news = {
            each: state
            for each, state in seen.items()
            if each not in self._seen
            or ((state is None or state in TERMINAL) and state is not self._seen[each])
        }
        self._seen = seen
        if news:
            self.server.take_in(TasksElsewhere(tuple(news.items())), now=now)

    def _talk(self, now: float) -> None:
        database = self.world.database
        if self._asked is not None:
            request, sent, at, is_in_time = self._asked
            if now < at:
                return
            self._asked = None
            if not self.is_reached or database.sessions.get(self.name) != self.session:
                self.session = None
                self._tell(self.member.unanswered(now), now=now)
                return
            row = database.execute(self.name, request)
            if not (is_in_time and self.hears):  # it is carried out all the same
                self.session = None
                self._tell(self.member.unanswered(now), now=now)
                return
            self._tell(self.member.answered(request, row, sent=sent, now=now), now=now)
        if self.session is None:
            if self.is_reached and database.is_up:
                self.session = database.connect(self.name, self._latest)
                self._latest = self.session or self._latest
            if self.session is None:
                self.member.next_turn = max(self.member.next_turn, now + 0.1)
                return
        heard, _, self.member.strays = self.engine.reach(now=now)
        self.member.heard = set(heard)
        request_or_none = self.member.request(now)
        if request_or_none is not None:
            delay = self.world.delay() if self.is_reached else GIVEN_UP
            self._asked = request_or_none, now, now + min(delay, GIVEN_UP), delay <= GIVEN_UP

    def _ping(self, now: float) -> None:
        for name in self.member.rivals.epochs():
            other = self.world.gateways.get(name)
            if other is None:
                continue
            if other.is_dead:
                self.member.peer_refused(name, now=now)
            elif self.is_pinged and other.is_pinged and not other.is_frozen:
                self.member.peer_answered(name, now=now)

    def _tell(self, change: Change, *, now: float) -> None:
        lease = self.member.lease
        self.effects += change.effects
        if Effect.DROP in change.effects:
            self._drop()
        is_holder = lease.standing in (Standing.HOLDER, Standing.STOPPING)
        move_until = lease.trusted_until if is_holder else -1.0
        stop_until = lease.permit().term_end if is_holder else -1.0
        self.server.take_in(LeaseChanged(move_until, stop_until), now=now)
        if change.got:
            self.got += [(now, vehicle) for vehicle in sorted(change.got)]
            for vehicle in change.got:
                self.world.taken(vehicle)
            self.store.load_vehicles(change.got)
        if change.lets_go:
            asked = [vehicle for vehicle, _ in change.lets_go]
            ours = self.engine.reach(now=now).ours
            self.server.take_in(VehiclesGone(tuple(asked)), now=now)
            gone = ours.intersection(asked) - self.engine.reach(now=now).ours
            self.let_go += [(now, vehicle) for vehicle in sorted(gone)]
            self.member.forgotten(gone)

    def _is_current(self) -> bool | None:
        if self.member.lease.standing in (Standing.OUT, Standing.EVICTED):
            return None
        row = self.world.database.rows.get(self.name)
        return row is not None and row.epoch == self.member.lease.epoch


class FleetWorld(World):
    """Rovers that every gateway hears. The first gateway is ``server``, a World's only one."""

    def __init__(
        self, folder: Path, *, names: Sequence[str] = ("server", "b"), seed: int = 0, **kw: Any
    ) -> None:
        self.database, self.shared = Database(), SharedStore(folder / "shared.sqlite3")
        self.shared.notify = self._notify
        #: how many of the notifications about tasks do not arrive
        self.lost_notices = 0.0
        #: how many of the database's answers take far too long
        self.slow = 0.0
        self.random = Random(seed)
        self.gateways: dict[str, Gateway] = {}
        self.clock_errors: dict[str, float] = {}  # of machines, s
        self.settings: Settings | None = kw.get("settings")
        self.keys: tuple[Key, ...] | None = kw.get("keys")
        self.wall_offset: float | None = kw.get("wall_offset")
        self.first_id: int = kw.get("first_id", 1)
        rovers = range(self.first_id, self.first_id + kw.get("rovers", 1))
        self.rover_names = tuple(f"rover{number}" for number in rovers)
        super().__init__(seed=seed, **kw)
        self.watched.serves = self._is_of_holder
        for name in names[1:]:
            self.watched.to_vehicles.add(VEHICLE_LINK.replace("server", name))
            self.watched.to_clients.add(CLIENT_LINK.replace("server", name))
            self.start(name)

    def _is_of_holder(self, link: str, rover: str) -> bool:
        return self.database.holder(int(rover.removeprefix("rover"))) == link.partition(":")[0]

    def dropped(self, gateway: str) -> None:
        """Note that a gateway has lost its lease: its new engine has no vehicle."""
        for vehicle, observer in enumerate(self.observers, self.first_id):
            if self.database.holder(vehicle) == gateway:
                observer.server_restarted()

    def taken(self, vehicle: int) -> None:
        """Note that a gateway has got a vehicle, as after a restart of the server."""
        observer = self.observers[vehicle - self.first_id]
        mode = observer.mode
        observer.server_restarted()
        if observer.stopped:  # it is found, and stopped, by the last heartbeat that came before
            observer.mode = mode

    def passes_on(self, gateway: str, data: bytes, arrived: float) -> None:
        """Note that a client's packet reaches the gateway that has the rover by way of another."""
        lease = self.gateways[gateway].member.lease
        for vehicle, observer in enumerate(self.observers, self.first_id):
            if lease.may_stop(vehicle, self.now):  # else nothing may leave now
                observer.asked(self.now, data, peer=f"{data[5]}")

    def policies_of(self, name: str) -> dict[str, LinkPolicy] | None:
        """Return the policies of a gateway's links: with a key, its rovers take only that."""
        if not self.keys:
            return None
        policy = LinkPolicy(takes_unsigned=False, key=self.keys[0].name)
        return {VEHICLE_LINK.replace("server", name): policy}

    def _new_server(self, _store: Store | None, _restored: Restored | None) -> Any:
        return self.gateways.setdefault("server", Gateway(self, "server"))

    def start(self, name: str) -> Gateway:
        """Start a gateway's process."""
        it = self.gateways[name] = Gateway(self, name)
        self.join(it)
        return it

    def kill(self, name: str) -> None:
        """SIGKILL: its machine closes its sockets."""
        it = self.gateways[name]
        it.is_dead = True
        self.leave(it)
        end = self.now + SESSION_ENDS

        def ends(now: float) -> None:
            sessions = self.database.sessions
            if now >= end and it.session is not None and sessions.get(name) == it.session:
                del sessions[name]

        self.watch(ends)

    def end(self, name: str) -> None:
        """SIGTERM: it stops its rovers, and leaves."""
        it = self.gateways[name]
        it.server.shut_down(now=self.now)
        self.until(lambda: it.pump.is_over, within=10)
        self.kill(name)

    def freeze(self, name: str) -> None:
        """SIGSTOP."""
        self.gateways[name].is_frozen = True

    def cut(self, name: str, vehicle: int = 1) -> None:
        """Let a vehicle out of the reach of a gateway."""
        self.watched.cut.add(frozenset((VEHICLE_LINK.replace("server", name), f"rover{vehicle}")))

    def mend(self, name: str, vehicle: int = 1) -> None:
        """Let a vehicle into the reach of a gateway again."""
        way = frozenset((VEHICLE_LINK.replace("server", name), f"rover{vehicle}"))
        self.watched.cut.discard(way)

    def holder(self, vehicle: int = 1) -> Gateway:
        """Return the gateway that has a vehicle, once its engine serves it."""
        found: list[Gateway] = []

        def is_held() -> bool:
            name = self.database.holder(vehicle)
            it = self.gateways.get(name or "")
            found[:] = [] if it is None or it.is_dead or it.is_frozen else [it]
            return bool(found) and self.serves(found[0], vehicle)

        self.until(is_held, within=10)
        return found[0]

    def serves(self, it: Gateway, vehicle: int) -> bool:
        """Return whether a gateway's engine has met a vehicle."""
        found = it.engine.snapshot(now=self.now).vehicles
        return vehicle in [each.system_id for each in found]

    def _notify(self) -> None:
        for it in self.gateways.values():
            if not it.is_dead and self.random.random() >= self.lost_notices:
                it.notified()

    def delay(self) -> float:
        """Return how long the database takes for an answer: seldom far too long."""
        if self.random.random() < self.slow:
            return self.random.uniform(0.05, 1.5)
        return self.random.uniform(0.002, 0.015)
