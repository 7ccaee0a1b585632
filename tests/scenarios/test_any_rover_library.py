"""Tasks for any rover with the client library: the handle follows the task to its rover."""

import pytest

from mav_tasks import (
    Face,
    GlobalPlace,
    GoTo,
    Move,
    TaskState,
)
from rover_sim.faults import Faults
from rover_sim.testing.rover_world import RoverWorld
from tests.scenarios.conftest import MakeRoverWorld


@pytest.fixture
def world(make_rover_world: MakeRoverWorld) -> RoverWorld:
    """Return a world of two rovers with a server that is ready."""
    world = make_rover_world(count=2)
    world.sleep(3)  # until their positions are known
    return world


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
