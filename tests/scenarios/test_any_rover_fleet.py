"""Tasks for any rover in a fleet: each gateway chooses among its rovers, a nonce is one task."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from mav_tasks.tasks.events import TaskAssigned
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from rover_sim.faults import Faults
from rover_sim.geo import DEFAULT_ORIGIN
from tests.kit.client import ACCEPTED, DENIED, MOVE, FakeClient, Sent
from tests.kit.gateways.engines import FleetWorld
from tests.kit.mission import Item, Upload

ANY = (250, 191)
WAYPOINT, OPTIONS, RELEASE, SKIP = 16, 54014, 54013, 2


class Fleet:
    """Gateway ``server`` has rover 1, and ``b`` has rovers 2 and 3; the same script is at both."""

    def __init__(self, folder: Path) -> None:
        self.world = FleetWorld(folder, rovers=3)
        self.world.cut("server", 2)
        self.world.cut("server", 3)
        self.world.cut("b", 1)
        self.here: FakeClient = self.world.client
        self.there = self.world.add_client("client b", server="b:clients")
        for rover, name in ((1, "server"), (2, "b"), (3, "b")):
            assert self.world.holder(rover).name == name
        self.world.run(4.0)

    def submit(self, client: FakeClient, metres: float = 0.5, *, nonce: int = 7) -> Sent:
        sent = client.move(metres, nonce=nonce, target=ANY)
        self.world.run(0.3)
        return sent

    def upload(
        self, client: FakeClient, *, nonce: int = 7, east: float = 1.0, after: int = 0
    ) -> Upload:
        x, y = DEFAULT_ORIGIN.to_global(0.0, east)
        options = Item(OPTIONS, nonce, 0, 5.0, 0.0, 0.0, after, frame=2)
        items = [Item(WAYPOINT, x, y, param1=0.01, param4=0.0), options]
        upload = Upload(client, items, target=ANY)
        self.world.until(lambda: upload.result is not None, within=5)
        return upload

    def tasks(self) -> dict[int, Task]:
        return {int(task.id): task for task in self.world.shared.tasks()}

    def known(self, name: str) -> set[int]:
        """Return the tasks that a gateway's engine has."""
        engine = self.world.gateways[name].engine
        return {int(task.id) for task in engine.snapshot(now=self.world.now).tasks}


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    it = Fleet(tmp_path)
    yield it
    it.world.check()


def test_a_nonce_that_another_gateway_has_had_is_its_task(fleet: Fleet) -> None:
    first = fleet.submit(fleet.here)
    again = fleet.submit(fleet.there)
    assert (again.result, again.task_id) == (ACCEPTED, first.task_id)
    assert list(fleet.tasks()) == [first.task_id]
    assert not fleet.known("b")
    fleet.world.run(5.0)
    assert [rover.autopilot.armed for rover in fleet.world.rovers[1:]] == [False, False]
    late = fleet.submit(fleet.there)  # the refused submission has left nothing behind
    assert late.task_id == first.task_id
    other = fleet.submit(fleet.there, 2.0)
    assert other.answer == (DENIED, R.NONCE_REUSED)
    new = fleet.submit(fleet.there, 0.5, nonce=8)
    assert fleet.tasks()[new.task_id].vehicle == 2


def test_a_stop_for_all_stops_a_rover_that_is_taken_later_and_no_other_again(
    tmp_path: Path,
) -> None:
    world = FleetWorld(tmp_path, rovers=2)
    world.cut("server", 2)
    world.cut("b", 1)
    assert [world.holder(rover).name for rover in (1, 2)] == ["server", "b"]
    world.run(4.0)
    world.mend("server", 2)
    world.watched.to_clients.clear()
    world.run(1.5)
    stopped = world.client.stop(target=(0, 191))
    world.run(0.1)
    going = world.client.proceed(target=(1, 191))
    world.run(0.1)
    assert (stopped.result, going.result) == (ACCEPTED, ACCEPTED)
    world.kill("b")
    assert world.holder(2).name == "server"
    world.run(1.0)
    assert world.shared.part(frozenset({1, 2})).paused == {2: R.STOPPED}


def test_while_a_gateway_dies_a_repeat_at_another_one_is_no_second_task(fleet: Fleet) -> None:
    later_on = 0.5, 0, 0, 7, 0, 10.0, 5  # it starts in 10 s
    fleet.here.command(MOVE, *later_on, target=ANY)
    fleet.world.until(fleet.tasks, within=1)
    fleet.world.kill("server")  # whether the client has read its ack or not
    fleet.world.mend("b", 1)
    at_once = fleet.there.command(MOVE, *later_on, target=ANY)
    fleet.world.run(0.02)
    assert not fleet.world.serves(fleet.world.gateways["b"], 1)
    (task,) = fleet.tasks()
    assert at_once.task_id == task
    assert fleet.world.holder(1).name == "b"
    fleet.world.run(2.0)
    again = fleet.there.command(MOVE, *later_on, target=ANY)
    fleet.world.until(lambda: fleet.tasks()[task].state is S.COMPLETED, within=30)
    assert again.task_id == task
    assert len(fleet.tasks()) == 1


def test_a_task_moves_at_the_gateway_that_has_it_now(fleet: Fleet) -> None:
    """Also after a takeover: the store has kept that any rover may drive it."""
    for metres, nonce in ((8.0, 1), (8.0, 2), (3.0, 3)):
        fleet.submit(fleet.there, metres, nonce=nonce)
    (task,) = (each for each in fleet.tasks().values() if each.marks.nonce == 3)
    assert task.vehicle == 2
    fleet.world.mend("server", 2)
    fleet.world.mend("server", 3)
    fleet.world.kill("b")
    assert fleet.world.holder(2).name == fleet.world.holder(3).name == "server"
    fleet.world.rovers[1].autopilot.set_faults(Faults(silent=True))
    fleet.world.run(20.0)
    assert fleet.tasks()[task.id].vehicle == 2  # a held task is ahead of it: an operator decides
    fleet.world.rovers[1].autopilot.set_faults(Faults())
    fleet.world.run(2.0)
    held = next(each for each in fleet.tasks().values() if each.marks.nonce == 1)
    assert held.state is S.HELD
    fleet.here.move(8.0, nonce=4, priority=9, target=(2, 191))
    fleet.world.run(0.5)
    fleet.here.command(RELEASE, held.id, SKIP, target=(2, 191))
    fleet.world.run(3.0)
    fleet.world.rovers[1].autopilot.set_faults(Faults(silent=True))
    fleet.world.run(15.0)
    (moved,) = (
        each
        for each in fleet.world.gateways["server"].store.events
        if isinstance(each, TaskAssigned)
    )
    assert (moved.task_id, moved.before, moved.vehicle) == (task.id, 2, 1)
    assert fleet.tasks()[task.id].vehicle == 1


@pytest.mark.parametrize("nonce", [0, 9])
def test_one_that_no_rover_here_can_drive_goes_to_another_gateway(fleet: Fleet, nonce: int) -> None:
    stopped = fleet.here.stop(target=(1, 191))
    fleet.world.run(0.3)
    assert stopped.result == ACCEPTED
    first = fleet.submit(fleet.here, 0.5, nonce=nonce)
    assert first.result == ACCEPTED
    assert fleet.tasks()[first.task_id].vehicle == 2
    fleet.here.proceed(target=(1, 191))  # from now on rover 1 could drive a copy
    fleet.world.run(2.0)
    copy = fleet.here.command(MOVE, 0.5, 0, 0, nonce, 0, 0, 5, target=ANY, confirmation=1)
    fleet.world.run(0.3)
    assert (copy.result, copy.task_id) == (ACCEPTED, first.task_id)
    assert list(fleet.tasks()) == [first.task_id]


def test_one_that_no_rover_of_the_fleet_can_drive_is_refused(fleet: Fleet) -> None:
    fleet.world.watched.to_clients.clear()  # the STOP takes its time to the other gateway
    fleet.here.stop(target=(0, 191))
    fleet.world.run(0.5)
    sent = fleet.submit(fleet.here)
    assert sent.result not in (None, ACCEPTED)
    assert not fleet.tasks()
