"""Tasks for any rover with the client library: the handle follows the task to its rover."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from mav_tasks import (
    Face,
    GlobalPlace,
    GoTo,
    LocalPlace,
    Move,
    NoSuchVehicle,
    Refused,
    TaskReason,
    TaskState,
)
from mav_tasks.settings import Settings
from rover_sim.faults import Faults
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld

MakeWorld = Callable[..., RoverWorld]


@pytest.fixture
def world() -> Iterator[RoverWorld]:
    """Return a world of two rovers with a server that is ready."""
    it = RoverWorld(RoverOptions(count=2), seed=1, settings=Settings())
    it.server.start()
    it.until(lambda: it.server.is_ready)
    it.sleep(3)  # until their positions are known
    yield it
    it.close()


def test_a_command_and_a_plan_go_to_the_free_rover(world: RoverWorld) -> None:
    with world.sync_client() as tasks:
        one = tasks.submit(Move(3.0), vehicle="any", label="first", deadline=60.0)
        two = tasks.submit([Face(1.0), Move(0.3)], vehicle="any")
        assert (one.vehicle, two.vehicle) == (1, 2)
        assert two.done().state is TaskState.COMPLETED
        assert one.done().label == "first"
        near = tasks.vehicles()[1]
        assert near.latitude is not None
        assert near.longitude is not None
        place = GlobalPlace(round(near.latitude * 1e7), round(near.longitude * 1e7))
        assert tasks.submit(GoTo(place), vehicle="any").vehicle == 2


def test_a_nonce_is_the_same_task(world: RoverWorld) -> None:
    with world.sync_client() as tasks:
        command = tasks.submit(Move(3.0), vehicle="any", nonce=5)
        assert tasks.submit(Move(3.0), vehicle="any", nonce=5).id == command.id
        plan = tasks.submit([Move(0.3), Move(0.3)], vehicle="any", nonce=6)
        assert tasks.submit([Move(0.3), Move(0.3)], vehicle="any", nonce=6).id == plan.id
        with pytest.raises(Refused) as refused:
            tasks.submit(Move(1.0), vehicle="any", nonce=5)
        assert refused.value.reason == TaskReason.NONCE_REUSED
        assert "nonce 5 was used for another task" in str(refused.value)


@pytest.mark.parametrize("goal", [Move(1.0), [Move(1.0), Face(0.0)]])
def test_the_words_of_a_refusal_come_with_it(world: RoverWorld, goal: Any) -> None:
    with world.sync_client() as tasks:
        tasks.stop()
        with pytest.raises(Refused, match="rover 1: STOP in force; rover 2: STOP in force"):
            tasks.submit(goal, vehicle="any")


def test_a_local_place_needs_a_rover(world: RoverWorld) -> None:
    with world.sync_client() as tasks:
        with pytest.raises(Refused, match="another place for each rover"):
            tasks.submit(GoTo(LocalPlace(1.0, 1.0)), vehicle="any")
        with pytest.raises(NoSuchVehicle):
            tasks.submit(Move(1.0))


def test_the_handle_follows_a_task_that_moves(world: RoverWorld) -> None:
    with world.sync_client() as tasks:
        for rover, metres in ((1, 12.0), (2, 4.0)):
            tasks.submit(Move(metres), vehicle=rover)
        world.sleep(2)
        task = tasks.submit(Move(0.5), vehicle="any")
        assert task.vehicle == 2
        world.rovers[1].set_faults(Faults(silent=True))
        assert task.done().vehicle == 1
        assert task.vehicle == 1
        task.refresh()
