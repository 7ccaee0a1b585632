"""Clients in a test's world: they drive the rover in no time, and what goes wrong is seen."""

from datetime import UTC, datetime, timedelta

import pytest

from mav_tasks import (
    Move,
    Rotate,
    SyncClient,
    TaskState,
)
from rover_sim.errors import NotInVirtualTime
from rover_sim.testing.rover_world import RoverWorld
from tests.unit.rover_sim.testing.conftest import MakeWorld


def start(world: RoverWorld) -> RoverWorld:
    """Start the server, as the fixture task_server does."""
    world.server.start()
    world.until(lambda: world.server.is_ready)
    return world


@pytest.fixture
def served(world: RoverWorld) -> RoverWorld:
    """Return a world with a server."""
    return start(world)


def states(world: RoverWorld) -> list[TaskState]:
    return [task.state for task in world.server.tasks]


def pose_after(world: RoverWorld) -> tuple[float, float, float, float]:
    """Drive over a bad link; gives where and when that ended, exactly."""
    start(world)
    world.lossy_link(loss=0.3, duplication=0.1, jitter=0.05)
    world.lossy_link(loss=0.05, leg="rover")
    with world.sync_client() as tasks:
        tasks.submit(Move(1.0)).done()
        tasks.submit(Rotate(1.0)).done()
    (rover,) = world.rovers
    return rover.north, rover.east, rover.yaw, world.now


def test_the_same_seed_gives_the_same_to_the_bit(make_world: MakeWorld) -> None:
    first, again, other = (pose_after(make_world(seed=seed)) for seed in (5, 5, 6))
    assert first == again
    assert first != other


def test_killed_and_started_again_the_server_has_its_tasks(served: RoverWorld) -> None:
    (rover,) = served.rovers
    with served.sync_client() as tasks:
        running, waiting = tasks.submit(Move(2.0)), tasks.submit(Move(1.0))
        served.until(lambda: rover.speed > 0.3)
        served.server.kill()
        assert not served.server.is_running
        served.until(lambda: rover.stands, within=10)
        start(served)
        assert states(served) == [TaskState.HELD, TaskState.QUEUED]
        served.sleep(3.0)
        tasks.release(running.id, "remainder")
        tasks.resume()
        waiting.done()
    assert states(served) == [TaskState.COMPLETED] * 2
    assert rover.north == pytest.approx(3.0, abs=0.1)
    words = [str(event) for event in served.server.events]
    assert sum(word.startswith("rover 1: task 1 submitted: move 2 m") for word in words) == 1


def test_it_has_a_time_of_day(served: RoverWorld) -> None:
    assert abs(served.utc - datetime.now(UTC)) < timedelta(seconds=30)
    with served.sync_client() as tasks:
        start_at = served.utc + timedelta(seconds=40)
        task = tasks.submit(Move(0.5), at=start_at)
        served.until(lambda: served.server.task(task.id).state is TaskState.STARTING)
        assert abs(served.utc - start_at) < timedelta(seconds=1)
        task.done()


def test_a_sync_client_inside_of_a_coroutine_is_refused(served: RoverWorld) -> None:
    async def mixes(tasks: SyncClient) -> None:
        tasks.submit(Move(1.0))

    with served.sync_client() as tasks, pytest.raises(NotInVirtualTime, match="await rover_world"):
        served.run(mixes(tasks))
