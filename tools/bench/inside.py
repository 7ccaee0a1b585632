"""Measures what needs no socket, of any revision that is on its path; prints rows as JSON.

It imports nothing of this package: ``PYTHONPATH=TREE python -P tools/bench/inside.py CASE``. A case
is one of the functions at the end, and its numbers.

An engine runs in virtual time. A turn is its work on commands that wait together:
``handle(Packets)``, ``take_packets``, ``take_events``, then ``handle(Committed)`` and both again.
The rover is armed and in HOLD, one task is starting (the rover does not follow the mode request
yet), and ten wait: a submission is only queued, and answered by COMMAND_ACK, STATUSTEXT and
TASK_STATUS.
"""

import gc
import json
import sys
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from cProfile import Profile
from itertools import repeat
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter, process_time_ns
from typing import Any

from mav_tasks.config.settings import Clients, Limits, Queueing, Roles, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, Input, LinkChanged, LinkSide, Packets
from mav_tasks.kinds import Move
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.shell.serve import tame_collector
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Draft, Marks, Submitter, Terms

CLIENTS, VEHICLES, CLIENT, ROVER = "clients", "vehicles", "client", "rover"
HOLD, ARMED, CUSTOM = 4, 128, 1  # ArduPilot Rover's mode, MAV_MODE_FLAG
MOVE, CONTINUE, REQUEST, INTERVAL, SET_MODE, ARM = 54000, 193, 512, 511, 176, 400
NO_LIMIT = 10_000_000
UNLIMITED = Settings(
    queueing=Queueing(capacity=NO_LIMIT, quota=NO_LIMIT),
    clients=Clients(stream_interval=0.0, packet_rate=1e9),
    roles=Roles(safety=Limits(quota=NO_LIMIT, rate=1e9)),
    arming="operator",
)
OBSERVED = Settings(clients=Clients(packet_rate=1e6), roles=Roles(unsigned="observer"))
BEAT = m.Heartbeat(6, 8, 0, 0, 4, 3)  # of a ground station
WAITING = 10  # tasks
TELEMETRY, A_SECOND = 0.05, 20  # s, and how often
MEETING = 5.0  # s, after which the server knows the rover
SETTLED = 30.0  # s, after which the server's requests to the rover have ended
APART = 0.1  # s, between the submissions of the waiting tasks
BETWEEN = 0.001  # s of virtual time between two turns
TURNS, ROUNDS = 100, 20  # turns with one engine; more would outlast the starting of the task
NOTHING = nullcontext()
STRANGERS_APART = 0.01  # s between two packets from one endpoint
FEW, MANY = 1_000, 100_000  # waiting tasks
SAMPLE = 2_000  # tasks submitted and taken while the others wait
SUBMITTER = Submitter("link", "127.0.0.1:50000", 255, 190)
SIMULATED = 30.0  # s
SETPOINT = m.SetPositionTargetLocalNed(0, 1, 1, 8, 0x05C7, 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0.3)
#: what a driver sends each second besides setpoints: for 20 Hz of telemetry, GUIDED, arming
DRIVER = (
    BEAT,
    *(
        m.CommandLong(1, 1, number, 0, first, second, 0, 0, 0, 0, 0)
        for number, first, second in (
            *((INTERVAL, m.LocalPositionNed.id, 5e4), (INTERVAL, m.Attitude.id, 5e4)),
            *((SET_MODE, 1, 15), (ARM, 1, 0)),
        )
    ),
)

Cells = Iterator[tuple[Any, ...]]  # of rows: what, figure, unit, yardstick, its name, goal


class Clock:
    """Adds up processor time, in ns, while it is entered."""

    spent = 0

    def __enter__(self) -> None:
        self.spent -= process_time_ns()

    def __exit__(self, *_: object) -> None:
        self.spent += process_time_ns()


class Calls(Profile):
    """Counts the calls of Python functions while it is entered.

    A comprehension is a function up to Python 3.11, and each step of a generator is a call.
    """

    def __init__(self) -> None:
        super().__init__(builtins=False)

    @property
    def count(self) -> int:
        """How many there were, without those of ``__exit__``."""
        own = Profile.__exit__.__code__
        return sum(each.callcount for each in self.getstats() if each.code is not own)


class World:
    """An engine with a scripted rover and client, in virtual time."""

    def __init__(self, settings: Settings, base_mode: int = CUSTOM) -> None:
        self.now = 0.0
        self.engine = Engine(settings, now=0.0)
        self._base_mode = base_mode
        self._rover, self._client = Encoder(Address(1, 1)).encode, Encoder(Address(245, 190)).encode
        self._events = self._submitted = self._ticks = 0
        self.turn(LinkChanged(VEHICLES, LinkSide.VEHICLES, True, (ROVER,)))
        self.turn(LinkChanged(CLIENTS, LinkSide.CLIENTS, True))

    @classmethod
    def with_queue(cls) -> "World":
        """Return one in the state in which turns are measured."""
        world = cls(UNLIMITED, CUSTOM | ARMED)
        world.run(MEETING)
        for _ in range(WAITING):
            world.turn(world.moves(1))
            world.run(APART)
        return world

    def moves(self, count: int) -> Packets:
        """Return the client's submissions of other tasks."""
        found = []
        for _ in range(count):
            self._submitted += 1
            params = 1.0, 0.0, 0.0, self._submitted, 0.0, 0.0, 5.0
            found.append((CLIENT, self._client(m.CommandLong(1, 191, MOVE, 0, *params))))
        return Packets(CLIENTS, found)

    def run(self, seconds: float, measured: Callable[[], Any] = nullcontext) -> None:
        """Advance time, and measure the effort of each wake-up."""
        end = self.now + seconds
        while self.now < end:
            due = self.engine.next_deadline() or end
            self.now = min(end, due, self._ticks * TELEMETRY)
            if due <= self.now:
                self.turn(None, measured())
            if self._ticks * TELEMETRY <= self.now:
                boot = round(self.now * 1000)
                self.say(m.Attitude(boot, 0, 0, 0, 0, 0, 0))
                self.say(m.LocalPositionNed(boot, 0, 0, 0, 0, 0, 0))
                self.say(m.GlobalPositionInt(boot, 0, 0, 0, 0, 0, 0, 0, 0))
                if self._ticks % A_SECOND == 0:
                    self.say(m.Heartbeat(10, 3, self._base_mode, HOLD, 3, 3))
                    self.turn(Packets(CLIENTS, [(CLIENT, self._client(BEAT))]))
                self._ticks += 1

    def say(self, message: m.Message) -> None:
        """Send a message of the rover."""
        self.turn(Packets(VEHICLES, [(ROVER, self._rover(message))]))

    def turn(self, item: Input | None, measured: Any = NOTHING) -> None:
        """Let the engine process an input, or what is due, and measure the effort.

        The rover accepts every command, and each event is committed.
        """
        engine, now = self.engine, self.now
        with measured:
            if item is None:
                engine.handle_deadline(now=now)
            else:
                engine.handle(item, now=now)
            packets, events = engine.take_packets(), engine.take_events()
            if item is None:
                engine.next_deadline()
        for outgoing in packets:
            for packet in split_datagram(outgoing.data) if outgoing.link == VEHICLES else ():
                message = Decoder().decode(packet)
                if isinstance(message, m.CommandLong):
                    self.say(m.CommandAck(message.command, 0))
        self._events += len(events)
        if events:
            self.turn(Committed(self._events), measured if item else NOTHING)


def allocated() -> int:
    """Return the bytes that are allocated and still reachable, if that is traced."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def timed(do: Callable[[], object]) -> float:
    """Return the seconds of a call."""
    begin = perf_counter()
    do()
    return perf_counter() - begin


# the cases


def calls(at_once: int, goal: int) -> Cells:
    """Calls of one turn for each command; the first turns only warm up the engine."""
    world = World.with_queue()
    for _ in range(3):
        world.run(3 * APART)
        counted = Calls()
        world.turn(world.moves(at_once), counted)
    figure = counted.count / at_once
    yield f"Python calls of one command, {at_once} waiting", figure, "", 0, "", f"≤ {goal}"


def idle() -> Cells:
    """Calls of each wake-up in 10 s, while one rover stands disarmed in HOLD."""
    world, found = World(UNLIMITED), list[Calls]()
    world.run(SETTLED)

    def another() -> Calls:
        found.append(Calls())
        return found[-1]

    world.run(10.0, another)
    counts, what = [each.count for each in found], "Python calls of an idle wake-up"
    yield f"{what}, median", median(counts), "", 0, "", "≤ 40"
    yield f"{what}, most in 10 s", max(counts), "", 0, "", "≤ 40"


def cpu() -> Cells:
    """Processor time of a turn: the least mean of three rounds, after one that only warms up."""
    means = []
    for _ in range(3):
        clock = Clock()
        for number in range(1 + ROUNDS):
            clock.spent *= bool(number > 1)
            world = World.with_queue()
            for _ in range(TURNS):
                world.run(BETWEEN)
                world.turn(world.moves(1), clock)
        means.append(clock.spent / (ROUNDS * TURNS) / 1e9)
    yield "processor of one command", min(means), "µs"


def strangers(*case: int) -> Cells:
    """What clients without rights cost, by endpoints, addresses at each of them, packets from each.

    Memory is measured by itself, as tracing it takes time.
    """
    tracemalloc.start()
    memory, _ = cost(*case)
    tracemalloc.stop()
    what = f"strangers, {case[0]} × {case[1]} addresses, {case[2]} packets each"
    yield f"{what}: memory", memory, "kB", 0, "", f"≤ {64 * case[0]} kB"
    yield f"{what}: processor, each", cost(*case)[1], "µs"


def cost(endpoints: int, addresses: int, packets: int) -> tuple[int, float]:
    """Return the bytes that strangers cost, and the processor seconds of one of their packets.

    Each sends commands, no two alike, within the rate of its role, observer: "continue", which it
    may not send, and requests.
    """
    world, clock, before = World(OBSERVED), Clock(), 0
    peers = [
        (("10.0.0.1", port), Encoder(Address(1 + number, 190)).encode)
        for number in range(addresses)
        for port in range(1, 1 + endpoints)
    ]
    for turn in range(-1, packets):  # in the first they only come
        for number, (peer, encode) in enumerate(peers):
            if number % endpoints == 0:
                world.now += STRANGERS_APART
                world.say(m.Heartbeat(10, 3, CUSTOM, HOLD, 3, 3))
                world.turn(None)
            command = CONTINUE if turn % 5 else REQUEST
            sent = m.CommandLong(1, 191, command, 0, 1, 0, 0, 0, turn, number, 0)
            packet = encode(sent if turn >= 0 else BEAT)
            world.turn(Packets(CLIENTS, [(peer, packet)]), clock)
        if turn < 0:
            clock.spent = 0
            before = allocated()
    return allocated() - before, clock.spent / packets / len(peers) / 1e9


def queue() -> Cells:
    """Many waiting tasks: the time to submit and take one, memory, restart; beside few."""
    tame_collector()  # as the server does
    few, many = submitted(FEW), submitted(MANY)
    yield f"submit + take a task, {MANY:,} wait", many, "µs", few, f"with {FEW:,}", "≤ 2×"
    tracemalloc.start()
    full = filled(10 * FEW)
    full[0].take_events()
    size = tracemalloc.get_traced_memory()[0] / (10 * FEW)
    tracemalloc.stop()
    yield "memory of a waiting task", size, "bytes", 0, "", "≤ 2,048 bytes"
    with TemporaryDirectory(dir=Path.cwd() / "build") as folder:
        path = Path(folder, "tasks.sqlite3")
        store = SqliteStore(path, wall_offset=lambda: 0.0)
        store.append(filled(MANY)[0].take_events())
        store.close()
        gc.collect()
        gc.disable()  # like the server, until everything is restored
        begin = perf_counter()
        store = SqliteStore(path, wall_offset=lambda: 0.0)
        Engine(UNLIMITED, now=monotonic(), restored=store.load())
        yield f"restart with {MANY:,} waiting", perf_counter() - begin, "s", 0, "", "≤ 3 s"
        store.close()


def drafts(first: int, last: int) -> Iterator[Draft]:
    """Yield submissions."""
    for number in range(first, last):
        marks = Marks(number, f"{number:018x}", f"{number:018x}")
        yield Draft(1, MOVE, Move(1.0 + number), SUBMITTER, Terms(priority=number % 11), marks)


def filled(count: int) -> tuple[TaskRegistry, PendingTasks]:
    """Return a queue in which so many tasks wait."""
    book = TaskRegistry()
    room = PendingTasks(book, UNLIMITED)
    for draft in drafts(0, count):
        room.submit(draft, now=draft.marks.nonce * 1e-3)
    return book, room


def submitted(count: int) -> float:
    """Return the seconds to submit and take a task while others wait."""
    book, room = filled(count)
    book.take_events()
    more = [*drafts(count, count + SAMPLE)]
    begin = perf_counter()
    for draft in more:
        room.submit(draft, now=count * 1e-3)
    for _ in more:
        first = room.queue(1).first()
        assert first is not None
        room.leave(book[first])
    return (perf_counter() - begin) / SAMPLE


def simulation() -> Cells:
    """A pybullet rover with MAVLink on a circle, seconds a second; beside bare stepping."""
    import pybullet  # noqa: PLC0415  # optional

    from rover_sim.body import Pose  # noqa: PLC0415
    from rover_sim.bullet import PHYSICS_RATE, BulletBody  # noqa: PLC0415
    from rover_sim.motion import CONTROL_PERIOD  # noqa: PLC0415
    from rover_sim.vehicle import make_vehicle  # noqa: PLC0415

    body = BulletBody(start=Pose())
    body.drive(0.5, 0.3)
    body.advance(1 / PHYSICS_RATE)  # sets one physics step per call
    steps = repeat(body._client, round(SIMULATED * PHYSICS_RATE))
    plain = timed(lambda: deque(map(pybullet.stepSimulation, steps), 0))
    body.close()
    vehicle = make_vehicle(BulletBody(start=Pose()), system_id=1, now=0.0)
    encode = Encoder(Address(250, 191)).encode

    def run() -> None:
        for step in range(round(SIMULATED / CONTROL_PERIOD)):
            now = step * CONTROL_PERIOD
            if step % round(0.05 / CONTROL_PERIOD) == 0:
                is_second = step % round(1 / CONTROL_PERIOD) == 0
                for each in DRIVER if is_second else (SETPOINT,):
                    vehicle.receive(encode(each), "driver", now=now)
            vehicle.handle_deadline(now=now)
            vehicle.take_packets()

    ours = SIMULATED / timed(run)
    assert abs(vehicle.truth.north) > 0.1, "the rover did not move"
    yield "simulated rover with MAVLink", ours, "s/s", SIMULATED / plain, "stepSimulation", "≥ 0.6×"


if __name__ == "__main__":
    case, *numbers = sys.argv[1:]
    print(json.dumps([*globals()[case](*map(int, numbers))]))
