"""Clients in a test's world: they drive the rover in no time, and what goes wrong is seen."""

import asyncio
from datetime import UTC, datetime, timedelta
from math import radians

import pytest

from mav_tasks import (
    Move,
    Rotate,
    SyncClient,
    TaskState,
)
from rover_sim.errors import NotInVirtualTime, Stalled
from rover_sim.faults import Faults
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


def test_a_script_drives_the_rover(served: RoverWorld) -> None:
    (rover,) = served.rovers
    with served.sync_client() as tasks:
        forward = tasks.submit(Move(2.0))
        turn = tasks.submit(Rotate(radians(90)))
        assert turn.done().state is TaskState.COMPLETED
        assert forward.id < turn.id
    assert (rover.north, rover.east) == pytest.approx((2.0, 0.0), abs=0.05)
    assert rover.heading == pytest.approx(90, abs=1)
    assert 8 < served.now < 30


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
    with served.sync_client() as tasks:
        running, waiting = tasks.submit(Move(2.0)), tasks.submit(Move(1.0))
        served.until(lambda: served.rovers[0].speed > 0.3)
        served.server.kill()
        assert not served.server.is_running
        served.until(lambda: served.rovers[0].stands, within=10)
        served.server.start()
        served.until(lambda: served.server.is_ready)
        assert states(served) == [TaskState.HELD, TaskState.QUEUED]
        served.sleep(3.0)
        tasks.release(running.id, "remainder")
        tasks.resume()
        waiting.done()
    assert states(served) == [TaskState.COMPLETED] * 2
    assert served.rovers[0].north == pytest.approx(3.0, abs=0.1)
    served.server.restart()
    assert states(served) == [TaskState.COMPLETED] * 2
    words = [str(event) for event in served.server.events]
    assert sum(word.startswith("rover 1: task 1 submitted: move 2 m") for word in words) == 1


def test_what_never_comes_is_told_with_who_waits_for_it(make_world: MakeWorld) -> None:
    world = start(make_world(limit=20.0))
    with world.sync_client() as tasks:
        task = tasks.submit(Move(1.0))
        world.rovers[0].set_faults(Faults(refuse_arm=True))
        world.rovers[0].set_mode("manual")

        async def waits_for_godot() -> None:
            await asyncio.Event().wait()

        with pytest.raises(Stalled, match="not over within 20 s of virtual time") as told:
            world.run(waits_for_godot())
        assert "waits_for_godot: await asyncio.Event().wait()" in str(told.value)
        world.sleep(15.0)  # what stalled is gone, and the next one has its own time
        assert task.refresh().id == task.id


def test_it_has_a_time_of_day(served: RoverWorld) -> None:
    assert abs(served.utc - datetime.now(UTC)) < timedelta(seconds=30)
    with served.sync_client() as tasks:
        start_at = served.utc + timedelta(seconds=100)
        task = tasks.submit(Move(0.5), at=start_at)
        served.sleep(50)
        served.server.restart()
        served.sleep(2)
        tasks.resume()
        served.until(lambda: served.server.task(task.id).state is TaskState.STARTING)
        assert abs(served.utc - start_at) < timedelta(seconds=1)
        task.done()


def test_a_sync_client_inside_of_a_coroutine_is_refused(served: RoverWorld) -> None:
    async def mixes(tasks: SyncClient) -> None:
        tasks.submit(Move(1.0))

    with served.sync_client() as tasks, pytest.raises(NotInVirtualTime, match="await rover_world"):
        served.run(mixes(tasks))
