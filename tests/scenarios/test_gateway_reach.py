"""A rover drives out of the reach of its gateway and into that of another one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, FakeClient
from tests.kit.gateways.engines import FleetWorld, Gateway

IN_TRANSIT = 3.0  # s, in which a rover that changes hands is still reached

MOVE, RELEASE, REMAINDER = 54000, 54013, 1


class Reach:
    """A world of gateways with a client at each; ``first`` has the rover at first."""

    def __init__(self, folder: Path, *, vehicle: int = 1, **kw: Any) -> None:
        self.vehicle = vehicle
        self.world = FleetWorld(folder, first_id=vehicle, **kw)
        self.clients = {"server": self.world.client}
        for number, name in enumerate(sorted(self.world.gateways.keys() - {"server"})):
            it = self.world.add_client(
                f"client {name}", system_id=254 - 2 * number, server=f"{name}:clients"
            )
            self.clients[name] = it
        self.first = self.world.holder(vehicle)
        self.world.run(4.0)

    @property
    def other(self) -> Gateway:
        """A gateway that does not have the rover at first."""
        return next(it for it in self.world.gateways.values() if it is not self.first)

    def client(self, it: Gateway) -> FakeClient:
        return self.clients[it.name]

    def task(self, task_id: int) -> Task:
        """Return a task as it is stored."""
        return {int(task.id): task for task in self.world.shared.tasks()}[task_id]

    def submit(self, metres: float, **kw: Any) -> int:
        """Submit a move at the gateway that has the rover; return its id."""
        at = self.world.holder(self.vehicle)
        sent = self.client(at).move(metres, target=(self.vehicle, 191), **kw)
        self.world.run(0.3)
        assert sent.result == ACCEPTED
        return sent.task_id

    def drives(self, task_id: int) -> None:
        self.until_state(task_id, S.EXECUTING)
        self.world.run(1.0)

    def until_state(self, task_id: int, state: S, *, within: float = 60) -> None:
        self.world.until(lambda: self.task(task_id).state is state, within=within)

    def goes_to(self, there: Gateway) -> None:
        """Drive into the reach of one gateway and out of that of all others."""
        for it in self.world.gateways.values():
            (self.world.mend if it is there else self.world.cut)(it.name, self.vehicle)
        self.world.until(lambda: self.is_at(there), within=20)

    def is_at(self, it: Gateway) -> bool:
        holder = self.world.database.holder(self.vehicle)
        return holder == it.name and self.world.serves(it, self.vehicle)

    def release(self, task_id: int) -> None:
        """Release a held task; words from before do not count just after a takeover."""
        self.world.run(4.5)
        client = self.client(self.world.holder(self.vehicle))
        sent = client.command(RELEASE, task_id, REMAINDER, target=(self.vehicle, 191))
        self.world.run(0.3)
        assert sent.result == ACCEPTED


@pytest.fixture
def reach(tmp_path: Path) -> Iterator[Reach]:
    it = Reach(tmp_path)
    yield it
    it.world.check()


def test_another_gateway_that_hears_the_rover_gets_it_and_its_tasks(reach: Reach) -> None:
    ran, waits = reach.submit(5.0), reach.submit(0.5)
    reach.drives(ran)
    reach.goes_to(reach.other)
    (dropped,), taken = reach.first.let_go, reach.other.got[-1]
    assert dropped[0] <= taken[0]
    assert not reach.world.serves(reach.first, 1)
    assert reach.world.stands()
    assert (reach.task(ran).state, reach.task(ran).reason) == (S.HELD, R.OUTCOME_UNKNOWN)
    assert reach.task(waits).state is S.QUEUED
    reach.release(ran)
    reach.until_state(waits, S.COMPLETED)
    assert reach.task(ran).state is S.COMPLETED
    assert abs(reach.world.truth.north - 5.5) < 0.1


def test_a_short_silence_changes_nothing(reach: Reach) -> None:
    task = reach.submit(5.0)
    reach.drives(task)
    reach.world.cut(reach.first.name)
    reach.world.run(4.0)
    assert reach.task(task).state is S.PAUSED
    reach.world.mend(reach.first.name)
    reach.until_state(task, S.COMPLETED)
    assert reach.world.database.takeovers == 0
    assert reach.first.let_go == []


def test_what_is_not_stored_keeps_the_rover(reach: Reach) -> None:
    reach.first.store.is_reached = False  # but its lease goes on
    reach.world.cut(reach.first.name)
    reach.world.run(12.0)  # that the rover is silent is not stored
    assert reach.world.database.holder(1) == reach.first.name
    reach.first.store.is_reached = True
    reach.world.until(lambda: reach.is_at(reach.other), within=5)


@for_each("far", [False, True])
def test_a_stop_while_the_rover_changes_hands_is_in_force_afterwards(
    tmp_path: Path, *, far: bool
) -> None:
    names = ("server", "b", "c")
    reach = Reach(tmp_path, settings=Settings(on_takeover="resume"), names=names)
    task = reach.submit(5.0)
    reach.drives(task)
    reach.world.watched.to_clients.clear()  # the observer expects a STOP that was read in force
    known = reach.first, reach.other
    third = next(it for it in reach.world.gateways.values() if it not in known)
    reach.world.cut(reach.first.name)
    reach.world.cut(third.name)
    reach.world.until(lambda: reach.first.let_go, within=20)
    assert not reach.is_at(reach.other)
    sent = reach.client(third if far else reach.first).stop()
    reach.world.until(lambda: reach.is_at(reach.other), within=IN_TRANSIT)
    reach.world.run(1.0)
    assert reach.world.shared.part(frozenset({1})).paused == {1: R.STOPPED}
    assert reach.task(task).state is S.KILLED
    assert sent.result == ACCEPTED
    reach.world.until(reach.world.stands, within=5)


def test_clients_of_the_gateway_that_gave_it_up_still_reach_it(reach: Reach) -> None:
    near = reach.client(reach.first)
    reach.goes_to(reach.other)
    reach.world.run(1.0)
    sent = near.move(0.5, nonce=9)
    reach.world.until(lambda: sent.ack is not None, within=3)
    assert sent.result == ACCEPTED
    reach.until_state(sent.task_id, S.COMPLETED)


def test_the_gateway_that_gave_it_up_sends_it_nothing_that_moves_or_asks(reach: Reach) -> None:
    task = reach.submit(8.0)
    reach.drives(task)
    reach.world.cut(reach.first.name)
    reach.world.until(lambda: reach.first.let_go, within=20)
    sent: list[bytes] = []

    def look(source: str, target: str, data: bytes) -> bool:
        is_beat = data[7] in (0, 111)  # HEARTBEAT, TIMESYNC: they change nothing
        if (source, target) == (f"{reach.first.name}:vehicles", "rover1") and not is_beat:
            sent.append(data)
        return False

    reach.world.watched.loses = look
    reach.world.mend(reach.first.name)
    reach.world.run(20.0)
    assert sent == []
