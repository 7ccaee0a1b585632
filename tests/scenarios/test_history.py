"""Finished tasks, as any client may list them; and when those that wait will start and end."""

import asyncio
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from mav_tasks import Client, GoTo, LocalPlace, Move, TaskReason, TaskState, Wait
from mav_tasks.settings import Settings
from rover_sim.faults import Faults
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld

MakeWorld = Callable[..., RoverWorld]
S = TaskState


@pytest.fixture
def make_world() -> Iterator[MakeWorld]:
    """Return a factory of worlds with a server that is ready."""
    worlds: list[RoverWorld] = []

    def make(*, seed: int = 1, **options: Any) -> RoverWorld:
        world = RoverWorld(RoverOptions(**options), seed=seed, settings=Settings())
        worlds.append(world)
        world.server.start()
        world.until(lambda: world.server.is_ready)
        return world

    yield make
    for world in worlds:
        world.close()


async def cancelled(client: Client, count: int, *, vehicle: int | None = None) -> list[int]:
    """Submit tasks and call each off, the last one first; return their ids, newest end first."""
    await client.pause(vehicle=vehicle)
    tasks = [await client.submit(Move(1.0), vehicle=vehicle) for _ in range(count)]
    for task in reversed(tasks):
        await task.cancel()
        await asyncio.sleep(0.5)
    return [task.id for task in tasks]


def test_finished_tasks_are_listed_newest_first_with_the_age_of_their_end(
    make_world: MakeWorld,
) -> None:
    world = make_world()

    async def script() -> None:
        async with world.client() as client:
            assert await client.history() == ()
            done = await client.submit(Move(0.5))
            await done.done()
            ended_at = world.now
            await asyncio.sleep(30.0)
            ids = await cancelled(client, 3)
        async with world.client() as other:  # another one, that has submitted nothing
            history = await other.history()
            assert [task.id for task in history] == [*ids, done.id]
            assert [task.state for task in history] == [S.CANCELLED] * 3 + [S.COMPLETED]
            first, last = history[-1], history[0]
            assert first.ended_ago == pytest.approx(world.now - ended_at, abs=0.2)
            assert last.ended_ago == pytest.approx(0.5, abs=0.1)
            assert first.execution_time is not None
            assert first.time_to_finish is None
            assert last.reason is TaskReason.CANCELLED
            assert [task.id for task in await other.history(limit=2)] == ids[:2]
            assert (await other.status(done.id)).ended_ago is not None

    world.run(script())


def test_history_outlives_a_restart_also_before_the_rover_is_heard(make_world: MakeWorld) -> None:
    world = make_world()

    async def before() -> list[int]:
        async with world.client() as client:
            return await cancelled(client, 3)

    ids = world.run(before())
    world.server.stop()
    world.rovers[0].set_faults(Faults(silent=True))
    world.sleep(60.0)
    world.server.start()

    async def after() -> None:
        async with world.client() as client:
            history = await client.history()
            assert [task.id for task in history] == ids
            assert history[0].ended_ago == pytest.approx(60.0, abs=5.0)

    world.run(after())


def test_a_waiting_task_starts_and_ends_about_when_it_was_foreseen(make_world: MakeWorld) -> None:
    world = make_world()

    async def script() -> None:
        async with world.client() as client:
            await client.submit(Move(2.0))
            way = await client.submit(GoTo(LocalPlace(2.0, 3.0), wait=2.0))
            last = await client.submit([Wait(3.0), GoTo(LocalPlace(0.0, 3.0))], after=way)
            await asyncio.sleep(2.0)
            asked_at = world.now
            queue = await client.queue()
            assert [task.id for task in queue.waiting] == [way.id, last.id]
            foreseen = [(task.time_to_start, task.time_to_finish) for task in queue.waiting]
            await way.done()
            assert foreseen[0][1] == pytest.approx(world.now - asked_at, abs=4.0)
            assert foreseen[1][0] == foreseen[0][1]
            await last.done()
            assert foreseen[1][1] == pytest.approx(world.now - asked_at, abs=8.0)

    world.run(script())
