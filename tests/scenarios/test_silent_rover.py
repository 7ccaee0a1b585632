"""A client that comes while a rover is silent finds the server, and is told how old its news is."""

from collections.abc import Callable, Iterator
from math import inf
from typing import Any

import pytest

from mav_tasks import Client, Move, NoAnswer, Refused, TaskReason, TaskState
from mav_tasks.config.settings import Settings
from rover_sim.faults import Faults
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld

MakeWorld = Callable[..., RoverWorld]
FIND = 1.0  # s, in which a server that is there is found: no rover's heartbeat is waited for


@pytest.fixture
def make_world() -> Iterator[MakeWorld]:
    """Return a factory of worlds whose server has started and heard its rovers."""
    worlds: list[RoverWorld] = []

    def make(*, is_silent: bool = False, **options: Any) -> RoverWorld:
        world = RoverWorld(RoverOptions(**options), seed=1, settings=Settings())
        worlds.append(world)
        if is_silent:
            world.rovers[0].set_faults(Faults(silent=True))
        world.server.start()
        world.until(lambda: is_silent or world.server.is_ready)
        return world

    yield make
    for world in worlds:
        world.close()


def fall_silent(world: RoverWorld, number: int = 0) -> None:
    """Have a rover say nothing more, until everybody has noticed."""
    world.rovers[number].set_faults(Faults(silent=True))
    world.sleep(6)


def test_every_question_is_answered_while_its_rover_is_silent(make_world: MakeWorld) -> None:
    world = make_world()
    with world.sync_client() as tasks:
        tasks.submit(Move(3.0))
        world.until(lambda: world.rovers[0].speed > 0.3)
    fall_silent(world)
    since = world.now
    with world.sync_client() as tasks:
        assert world.now - since < FIND
        (rover,) = tasks.vehicles()
        assert (rover.is_heard, rover.kind, rover.mode, rover.armed) == (
            False,
            "unknown",
            "unknown",
            None,
        )
        assert rover.heartbeat_age == pytest.approx(6.0, abs=1.1)
        queue = tasks.queue()
        assert queue.heartbeat_age == pytest.approx(6.0, abs=1.5)
        assert (queue.running, tasks.status(1).state) == (1, TaskState.PAUSED)
        assert tasks.submit(Move(1.0)).id == 2
        assert [task.id for task in tasks.queue().waiting] == [2]
        with pytest.raises(Refused, match="silent"):
            tasks.pause()  # it counts, and the rover cannot be told
        assert tasks.queue().paused is TaskReason.OPERATOR


def test_a_server_that_has_not_heard_its_rover_yet_tells_of_its_tasks_and_takes_a_stop(
    make_world: MakeWorld,
) -> None:
    world = make_world()
    with world.sync_client() as tasks:
        tasks.submit(Move(3.0))
        world.until(lambda: world.rovers[0].speed > 0.3)
    world.server.kill()
    world.rovers[0].set_faults(Faults(silent=True))
    world.server.start()
    world.sleep(5)
    with world.sync_client() as tasks:
        assert tasks.vehicles()[0].heartbeat_age == inf
        queue = tasks.queue()
        assert (queue.heartbeat_age, queue.running) == (inf, 1)
        assert tasks.status(1).state is TaskState.HELD
        with pytest.raises(Refused) as refused:
            tasks.submit(Move(1.0))
        assert refused.value.reason == TaskReason.VEHICLE_SILENT
        assert "only STOP works" in str(refused.value)
        with pytest.raises(Refused, match="no task 9"):
            tasks.status(9)
        with pytest.raises(Refused):
            tasks.timing(1)
        with pytest.raises(NoAnswer, match="rover 1 is silent"):
            tasks.mission_file()
        with pytest.raises(Refused, match="silent"):
            tasks.stop()  # it counts, and the rover cannot be told
    world.rovers[0].set_faults(Faults())
    world.sleep(3)
    with world.sync_client() as tasks:
        assert (tasks.vehicles()[0].is_heard, tasks.submit(Move(1.0)).id) == (True, 2)
        assert (tasks.queue().paused, tasks.vehicles()[0].mode) == (TaskReason.STOPPED, "HOLD")
        world.sleep(3)
        assert world.rovers[0].stands


def test_a_script_that_submits_just_after_the_server_came_back_is_not_refused(
    make_world: MakeWorld,
) -> None:
    """The rover is heard within a second, and a copy of the submission comes after that."""
    world = make_world()

    async def script() -> int:
        async with Client(world.link()) as tasks:
            await tasks.submit(Move(3.0))
            world.server.kill()
            world.server.start()
            return (await tasks.submit(Move(1.0))).id

    assert world.run(script()) == 2
