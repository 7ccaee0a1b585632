"""Attacks S1 and D5 by an observer: it must not fill the way between the server and a rover.

What a rover streams is what the server needs, and what the clients wish that are there; together no
more than the link carries. A radio that is fed too much delays the telemetry that a task is driven
by.
"""

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Roles, Settings
from mav_tasks.engine.inputs import LinkChanged, LinkSide
from mav_tasks.links.memory import Radio
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import REQUEST, SET_INTERVAL, FakeClient, command_long
from tests.kit.world import MODE_COMMAND, World
from tests.scenarios.conftest import MakeWorld

OBSERVER = 9  # system ids
SETTINGS = Settings(
    roles=Roles(addresses={"9/190": "observer", "10/190": "observer", "12/190": "operator"})
)
BAUD = 57_600
CAPACITY = BAUD / 10  # bytes/s, of a radio on a serial line
BUDGET = 0.7 * CAPACITY  # of it, for what is streamed
OWN = 3_300.0  # bytes/s, that the server asks for by itself, and heartbeats
#: all that ArduPilot streams
STREAMED = (1, 24, 26, 27, 29, 30, 32, 33, 36, 62, 65, 74, 116, 125, 129, 147, 152, 163, 178, 193)
FASTEST = 20_000  # µs
ABSENT = 400  # no message of ArduPilot


class Meter:
    """What goes over the link of the first rover, from now on."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.came: list[bytes] = []
        self.went: list[bytes] = []
        world.watched.loses = self._look

    def _look(self, source: str, target: str, data: bytes) -> bool:
        if (source, target) == ("rover1", VEHICLE_LINK):
            self.came.append(data)
        elif (source, target) == (VEHICLE_LINK, "rover1"):
            self.went.append(data)
        return False

    def rate(self, seconds: float) -> float:
        """Let time pass; give the bytes that came from the rover, each second."""
        self.came.clear()
        self.went.clear()
        self._world.run(seconds)
        return sum(map(len, self.came)) / seconds

    def hertz(self, seconds: float, message_id: int | None = None) -> float:
        """Let time pass; give how often a message came, or any."""
        self.rate(seconds)
        return sum(message_id in (None, data[7]) for data in self.came) / seconds


class Buffer(Radio):
    """A radio of 57,600 baud with a buffer of 16 KB: what is too much comes late, or not at all."""

    def __init__(self) -> None:
        super().__init__(bytes_per_second=CAPACITY, buffer=16_000)
        self.delays: list[float] = []

    def leaves_at(self, size: int, *, now: float) -> float | None:
        at = super().leaves_at(size, now=now)
        self.delays += [] if at is None else [at - now]
        return at


def radio(world: World) -> World:
    """Let the way to the rover be a serial line from now on."""
    change = LinkChanged(
        VEHICLE_LINK, LinkSide.VEHICLES, up=True, peers=("rover1",), capacity=CAPACITY
    )
    world.server.pump.handle(change, now=world.now)
    world.server.pump.turn(now=world.now)
    world.run(3.0)
    return world


def join(world: World, system_id: int) -> FakeClient:
    client = world.add_client(f"client {system_id}", system_id=system_id)
    world.run(2.0)
    return client


def wish_for_all(world: World, client: FakeClient, interval_us: float = FASTEST) -> None:
    """Ask for everything as often as can be."""
    for message_id in STREAMED:
        client.send(command_long(SET_INTERVAL, message_id, interval_us, target=(1, 1)))
        world.run(0.02)
    client.send(common.MAVLink_request_data_stream_message(1, 1, 0, 50, 1))
    world.run(25.0)  # changes are asked for one by one, to spare the radio


def leave(client: FakeClient) -> None:
    client.heartbeats = False


def test_telemetry_over_a_radio_with_a_buffer_stays_fresh(make_world: MakeWorld) -> None:
    world = radio(make_world(settings=SETTINGS))
    observer = join(world, OBSERVER)
    buffer = world.net.buffers["rover1", VEHICLE_LINK] = Buffer()
    wish_for_all(world, observer)
    observer.stream(common.MAVLink_param_request_list_message(1, 1), rate=10)
    observer.stream(command_long(REQUEST, 148, target=(1, 1)), rate=100)
    task = world.client.move(8.0, speed=1.0)
    world.run(1.0)
    buffer.delays.clear()
    world.until_state(task.task_id, S.COMPLETED)
    assert max(buffer.delays) < 0.2
    assert abs(world.truth.north - 8.0) < 0.1


def test_what_the_rover_has_not_got_is_asked_for_once(make_world: MakeWorld) -> None:
    world = make_world()
    went = Meter(world).went
    world.client.command(SET_INTERVAL, ABSENT, FASTEST, target=(1, 1))
    world.run(20.0)
    asked = [data for data in went if data[7] == MODE_COMMAND]
    assert len(asked) == 1


def test_when_it_has_left_everything_is_as_before(make_world: MakeWorld) -> None:
    world = make_world(settings=SETTINGS)
    meter = Meter(world)
    before = meter.hertz(10.0)
    observer = join(world, OBSERVER)
    wish_for_all(world, observer)
    world.run(10.0)
    leave(observer)
    world.run(110.0)
    after = meter.hertz(10.0)
    assert after == pytest.approx(before, rel=0.02)


def test_an_observer_does_not_fill_a_radio(make_world: MakeWorld) -> None:
    world = radio(make_world(settings=SETTINGS))
    observer = join(world, OBSERVER)
    meter = Meter(world)
    before = meter.rate(10.0)
    assert before < OWN
    observer.stream(command_long(REQUEST, 148, target=(1, 1)), rate=60)
    observer.stream(common.MAVLink_ping_message(0, 1, 1, 1), rate=60)
    observer.stream(common.MAVLink_param_request_read_message(1, 1, b"CRUISE_SPEED", -1), rate=60)
    world.run(10.0)
    assert meter.rate(10.0) < before + 0.1 * CAPACITY
    assert sum(map(len, meter.went)) / 10 < 0.1 * CAPACITY
    observer.end_streams()
    wish_for_all(world, observer)
    assert meter.rate(10.0) < BUDGET
