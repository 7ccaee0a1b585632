"""Tasks for any rover in a fleet: each gateway chooses among its rovers, a nonce is one task."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.client import ACCEPTED, DENIED, MOVE, FakeClient, Sent
from tests.kit.gateways.engines import FleetWorld
from tests.kit.mission import Item, Upload
from tests.kit.world import at

ANY = (250, 191)
WAYPOINT, OPTIONS, DENIED_PLAN = 16, 54014, 14


class Fleet(FleetWorld):
    """Gateway ``server`` has rover 1, and ``b`` has rovers 2 and 3; the same script is at both."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, rovers=3)
        self.cut("server", 2)
        self.cut("server", 3)
        self.cut("b", 1)
        self.here = self.client
        self.there = self.add_client("client b", server="b:clients")
        for rover, name in ((1, "server"), (2, "b"), (3, "b")):
            assert self.holder(rover).name == name
        self.run(4.0)

    def submit(self, client: FakeClient, metres: float = 0.5, *, nonce: int = 7) -> Sent:
        sent = client.move(metres, nonce=nonce, target=ANY)
        self.run(0.3)
        return sent

    def stored(self) -> dict[int, Task]:
        return {int(task.id): task for task in self.shared.tasks()}

    def known(self, name: str) -> set[int]:
        """Return the tasks that a gateway's engine has."""
        engine = self.gateways[name].engine
        return {int(task.id) for task in engine.snapshot(now=self.now).tasks}


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    it = Fleet(tmp_path)
    yield it
    it.check()


def test_a_nonce_that_another_gateway_has_had_is_its_task(fleet: Fleet) -> None:
    first = fleet.submit(fleet.here)
    again = fleet.submit(fleet.there)
    assert (again.result, again.task_id) == (ACCEPTED, first.task_id)
    assert list(fleet.stored()) == [first.task_id]
    assert not fleet.known("b")
    fleet.run(5.0)
    assert [rover.autopilot.armed for rover in fleet.rovers[1:]] == [False, False]
    late = fleet.submit(fleet.there)  # the refused submission has left nothing behind
    assert late.task_id == first.task_id
    other = fleet.submit(fleet.there, 2.0)
    assert other.answer == (DENIED, R.NONCE_REUSED)
    new = fleet.submit(fleet.there, 0.5, nonce=8)
    assert fleet.stored()[new.task_id].vehicle == 2


def test_heartbeats_of_gateways_and_of_what_nobody_drives_are_of_no_rover(fleet: Fleet) -> None:
    for system, component, autopilot in ((250, 191, 8), (9, 1, 5)):
        beat = common.MAVLink_heartbeat_message(10, autopilot, 0, 0, 4, 3)
        packet = beat.pack(common.MAVLink(None, system, component))
        fleet.net.send("stranger", VEHICLE_LINK, packet)
    fleet.run(1.0)
    known = fleet.gateways["server"].engine.snapshot(now=fleet.now).vehicles
    assert [vehicle.system_id for vehicle in known] == [1]


def test_a_plan_with_a_nonce_that_another_gateway_has_had_is_its_task(fleet: Fleet) -> None:
    def upload(client: FakeClient, metres: float) -> Upload:
        items = [Item(WAYPOINT, **at(metres, 0)), Item(OPTIONS, 7, param4=0.0, frame=2)]
        sent = Upload(client, items, target=ANY)
        fleet.run(0.5)
        return sent

    first = upload(fleet.here, 1.0)
    again = upload(fleet.there, 1.0)
    assert (first.result, again.result, again.opaque_id) == (0, 0, first.opaque_id)
    assert upload(fleet.there, 2.0).result == DENIED_PLAN
    assert list(fleet.stored()) == [first.opaque_id]


def test_a_stop_for_all_stops_a_rover_that_is_taken_later_and_no_other_again(
    tmp_path: Path,
) -> None:
    world = FleetWorld(tmp_path, rovers=2)
    world.cut("server", 2)
    world.cut("b", 1)
    assert [world.holder(rover).name for rover in (1, 2)] == ["server", "b"]
    world.run(4.0)
    world.mend("server", 2)
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
    fleet.until(fleet.stored, within=1)
    fleet.kill("server")  # whether the client has read its ack or not
    fleet.mend("b", 1)
    at_once = fleet.there.command(MOVE, *later_on, target=ANY)
    fleet.run(0.02)
    assert not fleet.serves(fleet.gateways["b"], 1)
    (task,) = fleet.stored()
    assert at_once.task_id == task
    assert fleet.holder(1).name == "b"
    fleet.run(2.0)
    again = fleet.there.command(MOVE, *later_on, target=ANY)
    fleet.until(lambda: fleet.stored()[task].state is S.COMPLETED, within=30)
    assert again.task_id == task
    assert len(fleet.stored()) == 1


@pytest.mark.parametrize("nonce", [0, 9])
def test_one_that_no_rover_here_can_drive_goes_to_another_gateway(fleet: Fleet, nonce: int) -> None:
    stopped = fleet.here.stop(target=(1, 191))
    fleet.run(0.3)
    assert stopped.result == ACCEPTED
    first = fleet.submit(fleet.here, 0.5, nonce=nonce)
    assert first.result == ACCEPTED
    assert fleet.stored()[first.task_id].vehicle == 2
    fleet.here.proceed(target=(1, 191))  # from now on rover 1 could drive a copy
    fleet.run(2.0)
    copy = fleet.here.command(MOVE, 0.5, 0, 0, nonce, 0, 0, 5, target=ANY, confirmation=1)
    fleet.run(0.3)
    assert (copy.result, copy.task_id) == (ACCEPTED, first.task_id)
    assert list(fleet.stored()) == [first.task_id]


def test_one_that_no_rover_of_the_fleet_can_drive_is_refused(fleet: Fleet) -> None:
    fleet.here.stop(target=(0, 191))
    fleet.run(0.5)
    sent = fleet.submit(fleet.here)
    assert sent.result not in (None, ACCEPTED)
    assert not fleet.stored()
