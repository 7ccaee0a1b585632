"""One server, many rovers on many links: each is driven as if it were the only one."""

from collections import deque
from collections.abc import Callable
from itertools import pairwise
from math import radians, remainder, tau
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.engine.inputs import LinkChanged, LinkSide
from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from rover_sim.virtual import RoverParty
from tests.kit.client import (
    ACCEPTED,
    ACK,
    MOVE,
    REPEATS,
    REQUEST,
    ROTATE,
    SET_INTERVAL,
    TASK_STATUS,
)
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

ROVERS, LINKS = 9, 4
TROUBLE_AFTER = 3.0  # s of driving
SLOW = 1.5  # s that each packet of a slow rover takes
FLOOD = 500  # packets a second


class SlowParty(RoverParty):
    """A rover all of whose packets arrive late."""

    def __init__(self, party: RoverParty) -> None:
        super().__init__(party.vehicle, self)  # type: ignore[arg-type]
        self._real = party._link
        self._late: deque[tuple[float, Any, bytes]] = deque()
        self._now = 0.0

    @property
    def arrived(self) -> Any:
        return self._real.arrived

    def receive(self, limit: int) -> Any:
        return self._real.receive(limit)

    def send(self, peer: Any, data: bytes) -> None:
        self._late.append((self._now + SLOW, peer, data))

    def turn(self, *, now: float) -> None:
        self._now = now
        super().turn(now=now)
        while self._late and self._late[0][0] <= now:
            _, peer, data = self._late.popleft()
            self._real.send(peer, data)


class Flooder:
    """Sends texts in the name of rover 1, far more than anybody asked for."""

    def __init__(self, world: World) -> None:
        self._net, self._at = world.net, world.now
        self._mav = common.MAVLink(None, 1, 1)

    def next_deadline(self) -> float:
        return self._at

    def turn(self, *, now: float) -> None:
        while self._at <= now:
            self._at += 1.0 / FLOOD
            text = common.MAVLink_statustext_message(6, b"I talk and talk")
            self._net.send("rover1", VEHICLE_LINK, text.pack(self._mav))


def test_each_task_is_run_by_its_own_rover(make_world: MakeWorld) -> None:
    world = make_world(rovers=ROVERS, vehicle_links=LINKS)
    other = world.add_client("other", system_id=254)
    world.run(0.1)
    for number in range(1, ROVERS + 1):
        target = number, 191
        world.client.command(MOVE, 0.3 * number, 0, 0, number, 0, 0, 5, target=target)
        other.command(ROTATE, 10.0 * number, 0, 0, number, 0, 0, 5, target=target)
    world.until_idle(tasks=2 * ROVERS)
    assert {task.state for task in world.tasks()} == {S.COMPLETED}
    assert sorted(task.id for task in world.tasks()) == list(range(1, 2 * ROVERS + 1))
    for number, rover in enumerate(world.rovers, 1):
        truth = rover.truth
        assert (truth.north, truth.east) == pytest.approx(
            (0.3 * number, 3.0 * (number - 1)), abs=0.02
        )
        assert abs(remainder(truth.yaw - radians(10.0 * number), tau)) < radians(1)


def goes_silent(world: World) -> None:
    world.fault(Faults(silent=True))


def is_dead(world: World) -> None:
    world.fault(Faults(silent=True, deaf=True))


def refuses(world: World) -> None:
    world.fault(Faults(refuse_arm=True, refuse_mode=True))
    world.operator_mode(Mode.HOLD)


def is_slow(world: World) -> None:
    party = world.rover_parties[0]
    world.leave(party)
    world.join(SlowParty(party))


def floods(world: World) -> None:
    world.join(Flooder(world))


def loses_its_link(world: World) -> None:
    change = LinkChanged(VEHICLE_LINK, LinkSide.VEHICLES, up=False)
    world.server.pump.handle(change, now=world.now)


def is_stopped(world: World) -> None:
    world.client.stop(target=(1, 191))


def life_of_second(world: World, trouble: Callable[[World], None] | None) -> list[Any]:
    """Two rovers on two links drive; gives all that the second was sent, and its tasks' lives."""
    for order, distance in enumerate((2.0, -1.0), 1):
        for number in (1, 2):
            world.client.move(distance, nonce=10 * number + order, target=(number, 191))
            world.run(0.1)
    world.run(TROUBLE_AFTER)
    if trouble is not None:
        trouble(world)
    world.until(
        lambda: [t.state for t in world.tasks() if t.vehicle == 2] == [S.COMPLETED] * 2, within=60
    )
    world.run(3)
    sent = [
        (round(at, 6), message.get_type(), getattr(message, "vx", None))
        for at, message in world.observers[1].driven
    ]
    return [sent, [world.history(task.id) for task in world.tasks() if task.vehicle == 2]]


@pytest.mark.parametrize(
    "trouble", [goes_silent, is_dead, refuses, is_slow, floods, loses_its_link, is_stopped]
)
def test_whatever_befalls_one_changes_nothing_for_another(
    make_world: MakeWorld, trouble: Callable[[World], None]
) -> None:
    undisturbed = life_of_second(make_world(rovers=2, vehicle_links=2), None)
    disturbed = life_of_second(make_world(rovers=2, vehicle_links=2), trouble)
    assert len(undisturbed[0]) > 100
    assert disturbed == undisturbed  # to the microsecond


def test_stop_for_all_reaches_every_link_and_is_kept_for_a_silent_one(
    make_world: MakeWorld,
) -> None:
    world = make_world(rovers=3, vehicle_links=3)
    for number in (1, 2, 3):
        world.client.move(20, nonce=number, target=(number, 191))
    world.run(4)
    world.fault(Faults(silent=True, deaf=True))
    world.run(4)
    at = world.now
    world.client.stop(target=(0, 0))
    world.run(0.1)
    for observer in world.observers[1:]:
        assert set(observer.sent_since(at)[:2]) == {"zero", "HOLD"}
    world.run(5)
    assert world.stands(2)
    assert world.stands(3)
    vehicles = world.server.engine.snapshot(now=world.now).vehicles
    assert {vehicle.paused for vehicle in vehicles} == {R.STOPPED}
    world.fault(Faults())
    world.run(3)
    assert world.stands(1)
    assert world.rover.autopilot.mode is Mode.HOLD


def test_stop_for_one_leaves_the_others_alone(make_world: MakeWorld) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    for number in (1, 2):
        world.client.move(3, nonce=number, target=(number, 191))
    world.run(3)
    world.client.stop(target=(1, 191))
    world.until_state(2, S.COMPLETED)
    assert world.state(1) == (S.KILLED, R.STOP)
    assert world.rovers[1].truth.north == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize("fails", [False, True])
def test_one_runs_after_anothers_task_over_links(make_world: MakeWorld, fails: bool) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    world.client.move(2, target=(1, 191))
    world.run(0.1)
    world.client.command(MOVE, 1.0, 0, 0, 0, 1, 0, 5, target=(2, 191))
    world.run(3)
    assert world.state(2) == (S.BLOCKED, R.NONE)
    if fails:
        world.client.stop(target=(1, 191))
        world.run(0.2)
        assert world.state(2) == (S.FAILED, R.DEPENDENCY_FAILED)
        assert world.stands(2)
    else:
        world.until_state(1, S.COMPLETED)
        world.until_state(2, S.COMPLETED)


def test_another_of_the_same_id_on_another_link_is_never_driven(make_world: MakeWorld) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    impostor, link = common.MAVLink(None, 1, 1), world.net.link("impostor")
    heartbeat = common.MAVLink_heartbeat_message(10, 3, 1, 4, 4, 3)
    world.client.move(3)
    for _ in range(8):
        link.send(f"{VEHICLE_LINK}2", heartbeat.pack(impostor))
        world.run(0.5)
    world.until_idle(tasks=1)
    assert (world.state(1)[0], list(link.arrived)) == (S.COMPLETED, [])
    assert any("another of this id" in text for text in world.client.texts())


def test_what_is_asked_of_one_rovers_queue_shows_no_other(make_world: MakeWorld) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    for number in range(6):
        target = 1 + number % 2, 191
        world.client.command(MOVE, 1.0, 0, 0, number + 1, 0, 500.0, 5, target=target)
        world.run(0.05)
    world.client.received.clear()
    sent = world.client.command(REQUEST, TASK_STATUS, 0, 0, target=(2, 191))
    world.run(0.1)
    assert sent.result == ACCEPTED
    assert [status.task_id for status in world.client.statuses()] == [2, 4, 6]


def test_who_repeats_itself_to_several_rovers_drives_each_of_them_once(
    make_world: MakeWorld,
) -> None:
    world = make_world(rovers=3, vehicle_links=3)
    until = world.now + 1.2
    world.watched.loses = lambda source, _, data: (
        source == CLIENT_LINK and data[7] == ACK and world.now < until
    )
    for number in (1, 2, 3):
        world.client.command(MOVE, 1.0, 0, 0, 0, 0, 0, 5, target=(number, 191), repeats=REPEATS)
    world.run(3)
    assert [task.vehicle for task in world.tasks()] == [1, 2, 3]


@pytest.mark.parametrize("is_driving", [False, True])
def test_another_of_the_same_id_is_not_driven_either_when_the_first_falls_silent(
    make_world: MakeWorld, is_driving: bool
) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    impostor, link = common.MAVLink(None, 1, 1), world.net.link("impostor")
    heartbeat = common.MAVLink_heartbeat_message(10, 3, 1, 4, 4, 3)
    if is_driving:
        world.client.move(10)
    for step in range(30):
        if step == 6:
            world.fault(Faults(silent=True))
        link.send(f"{VEHICLE_LINK}2", heartbeat.pack(impostor))
        world.run(0.5)
    assert list(link.arrived) == []
    assert not world.server.engine.snapshot(now=world.now).vehicles[0].heard


def test_after_a_link_was_down_its_rovers_get_heartbeats_without_gaps(
    make_world: MakeWorld,
) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    pump, name = world.server.pump, f"{VEHICLE_LINK}2"
    seen: list[tuple[float, int]] = []
    carry = world.net.send

    def note(source: str, target: str, data: bytes) -> None:
        if target == "rover2" and data[5] == 250:
            seen.append((world.now, data[4]))
        carry(source, target, data)

    world.watched.send = note  # type: ignore[method-assign]
    world.run(3)
    pump.handle(LinkChanged(name, LinkSide.VEHICLES, up=False), now=world.now)
    world.run(3)
    at = world.now
    pump.handle(LinkChanged(name, LinkSide.VEHICLES, up=True), now=world.now)
    world.run(3)
    assert sum(when > at for when, _ in seen) >= 2
    numbers = [number for _, number in seen]
    assert all((after - before) % 256 == 1 for before, after in pairwise(numbers))


def test_a_stream_of_statuses_is_of_the_rover_that_was_asked(make_world: MakeWorld) -> None:
    world = make_world(rovers=2, vehicle_links=2)
    watcher = world.add_client("watcher", system_id=77)
    for number in (1, 2):
        world.client.move(10, nonce=number, target=(number, 191))
    world.run(3)
    watcher.command(SET_INTERVAL, TASK_STATUS, 100_000, target=(1, 191))
    world.run(1)
    assert {packet.source for packet in watcher.of_id(TASK_STATUS)} == {(1, 191)}
    watcher.command(510, TASK_STATUS, target=(1, 191))
    watcher.command(510, TASK_STATUS, target=(2, 191))
    world.run(0.1)
    intervals = [m.interval_us for m in watcher.of_type("MESSAGE_INTERVAL")]
    assert intervals == [100_000, -1]
