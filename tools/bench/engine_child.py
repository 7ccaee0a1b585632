"""Measures one engine in virtual time, of any revision that is on its path; prints JSON.

It imports nothing of this package: ``PYTHONPATH=TREE python -P tools/bench/engine_child.py WHAT``.

``calls [AT_ONCE]`` counts the calls of Python functions of one TASK_MOVE. A turn is the engine's
work on commands that wait together, 1 by default: ``handle(Packets)``, ``take_packets``,
``take_events``, then ``handle(Committed)`` and both again. The rover is armed and in HOLD, one task
is starting (the rover does not follow the mode request yet), and ten wait: a submission is only
queued, and answered by COMMAND_ACK, STATUSTEXT and TASK_STATUS. ``cpu`` gives the processor seconds
of a turn.

``idle`` counts the calls of each idle wake-up of 10 s: ``handle_deadline``, ``take_packets``,
``take_events`` and ``next_deadline``, with one rover that stands disarmed in HOLD.

``strangers ENDPOINTS ADDRESSES PACKETS`` gives the bytes that they cost, and the processor seconds
of one of their packets. Each address at each endpoint sends so many commands, no two alike, within
the rate of its role, observer: "continue", which it may not send, and requests.
"""

import gc
import json
import sys
import tracemalloc
from collections.abc import Callable
from contextlib import nullcontext
from cProfile import Profile
from time import process_time_ns
from typing import Any

from mav_tasks.config.settings import Clients, Limits, Queueing, Roles, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, Input, LinkChanged, LinkSide, Packets
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram

CLIENTS, VEHICLES, CLIENT, ROVER = "clients", "vehicles", "client", "rover"
HOLD, ARMED, CUSTOM = 4, 128, 1  # ArduPilot Rover's mode, MAV_MODE_FLAG
MOVE, CONTINUE, REQUEST = 54000, 193, 512
MANY = 10_000_000
UNLIMITED = Settings(
    queueing=Queueing(capacity=MANY, quota=MANY),
    clients=Clients(stream_interval=0.0, packet_rate=1e9),
    roles=Roles(safety=Limits(quota=MANY, rate=1e9)),
    arming="operator",
)
OBSERVED = Settings(clients=Clients(packet_rate=1e6), roles=Roles(unsigned="observer"))
WAITING = 10  # tasks
TELEMETRY, A_SECOND = 0.05, 20  # s, and how often
MEETING = 5.0  # s, after which the server knows the rover
SETTLED = 30.0  # s, after which the server's requests to the rover have ended
APART = 0.1  # s, between the submissions of the waiting tasks
BETWEEN = 0.001  # s of virtual time between two turns
TURNS, ROUNDS = 100, 20  # turns with one engine; more would outlast the starting of the task
NOTHING = nullcontext()
STRANGERS_APART = 0.01  # s between two packets from one endpoint


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
        return sum(
            each.callcount for each in self.getstats() if each.code is not Profile.__exit__.__code__
        )


class World:
    """An engine with a scripted rover and client, in virtual time."""

    def __init__(self, settings: Settings, base_mode: int = CUSTOM) -> None:
        self.now = 0.0
        self.engine = Engine(settings, now=0.0)
        self._base_mode = base_mode
        self._rover, self._client = Encoder(Address(1, 1)).encode, Encoder(Address(245, 190)).encode
        self._events = self._submitted = self._ticks = 0
        self.take(LinkChanged(VEHICLES, LinkSide.VEHICLES, True, (ROVER,)))
        self.take(LinkChanged(CLIENTS, LinkSide.CLIENTS, True))

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
                self.wake(measured())
            if self._ticks * TELEMETRY <= self.now:
                boot = round(self.now * 1000)
                self.say(m.Attitude(boot, 0, 0, 0, 0, 0, 0))
                self.say(m.LocalPositionNed(boot, 0, 0, 0, 0, 0, 0))
                self.say(m.GlobalPositionInt(boot, 0, 0, 0, 0, 0, 0, 0, 0))
                if self._ticks % A_SECOND == 0:
                    self.say(m.Heartbeat(10, 3, self._base_mode, HOLD, 3, 3))
                    beat = self._client(m.Heartbeat(6, 8, 0, 0, 4, 3))
                    self.take(Packets(CLIENTS, [(CLIENT, beat)]))
                self._ticks += 1

    def wake(self, measured: Any = NOTHING) -> None:
        """Let the engine do what is due."""
        engine, now = self.engine, self.now
        with measured:
            engine.handle_deadline(now=now)
            packets, events = engine.take_packets(), engine.take_events()
            engine.next_deadline()
        self._follow(packets, events, NOTHING)

    def say(self, message: m.Message) -> None:
        """Send a message of the rover."""
        self.take(Packets(VEHICLES, [(ROVER, self._rover(message))]))

    def take(self, item: Input, measured: Any = NOTHING) -> None:
        """Let the engine process an input and its consequences, and measure the effort."""
        engine, now = self.engine, self.now
        with measured:
            engine.handle(item, now=now)
            packets, events = engine.take_packets(), engine.take_events()
        self._follow(packets, events, measured)

    def _follow(self, packets: Any, events: Any, measured: Any) -> None:
        """Let the rover accept every command, and commit every event."""
        for outgoing in packets:
            for packet in split_datagram(outgoing.data) if outgoing.link == VEHICLES else ():
                message = Decoder().decode(packet)
                if isinstance(message, m.CommandLong):
                    self.say(m.CommandAck(message.command, 0))
        self._events += len(events)
        if events:
            self.take(Committed(self._events), measured)


def with_queue() -> World:
    """Return an engine in the state in which turns are measured."""
    world = World(UNLIMITED, CUSTOM | ARMED)
    world.run(MEETING)
    for _ in range(WAITING):
        world.take(world.moves(1))
        world.run(APART)
    return world


def calls(at_once: int = 1) -> float:
    """Return the calls of one turn for each command; the first turns only warm up the engine."""
    world = with_queue()
    for _ in range(3):
        world.run(3 * APART)
        counted = Calls()
        world.take(world.moves(at_once), counted)
    return counted.count / at_once


def idle() -> list[int]:
    """Return the calls of each wake-up during some idle seconds."""
    world = World(UNLIMITED)
    world.run(SETTLED)
    found: list[Calls] = []

    def another() -> Calls:
        found.append(Calls())
        return found[-1]

    world.run(10.0, another)
    return [each.count for each in found]


def cpu() -> float:
    """Return the mean processor seconds of a turn."""
    clock = Clock()
    for number in range(1 + ROUNDS):  # the first only warms up
        clock.spent *= bool(number > 1)
        world = with_queue()
        for _ in range(TURNS):
            world.run(BETWEEN)
            world.take(world.moves(1), clock)
    return clock.spent / (ROUNDS * TURNS) / 1e9


def cost(endpoints: int, addresses: int, packets: int) -> tuple[int, float]:
    """Return the bytes that strangers cost, and the processor seconds of one of their packets."""
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
                world.wake()
            message: m.Message = m.Heartbeat(6, 8, 0, 0, 4, 3)
            if turn >= 0:
                command = CONTINUE if turn % 5 else REQUEST
                message = m.CommandLong(1, 191, command, 0, 1, 0, 0, 0, turn, number, 0)
            world.take(Packets(CLIENTS, [(peer, encode(message))]), clock)
        if turn < 0:
            clock.spent = 0
            before = allocated()
    return allocated() - before, clock.spent / packets / len(peers) / 1e9


def strangers(*case: int) -> tuple[int, float]:
    """Return what strangers cost; memory by itself, as tracing it takes time."""
    tracemalloc.start()
    memory, _ = cost(*case)
    tracemalloc.stop()
    return memory, cost(*case)[1]


def allocated() -> int:
    """Return the bytes that are allocated and still reachable, if that is traced."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


WHAT = {"calls": calls, "idle": idle, "cpu": cpu, "strangers": strangers}

if __name__ == "__main__":
    print(json.dumps(WHAT[sys.argv[1]](*map(int, sys.argv[2:]))))  # type: ignore[operator]
