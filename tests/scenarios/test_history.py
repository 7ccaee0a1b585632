"""Finished tasks, as any client may list them."""

import asyncio

import pytest

from mav_tasks import Client, Move, TaskReason, TaskState
from tests.scenarios.conftest import MakeRoverWorld

S = TaskState


async def cancelled(client: Client, count: int, *, vehicle: int | None = None) -> list[int]:
    """Submit tasks and call each off, the last one first; return their ids, newest end first."""
    await client.pause(vehicle=vehicle)
    tasks = [await client.submit(Move(1.0), vehicle=vehicle) for _ in range(count)]
    for task in reversed(tasks):
        await task.cancel()
        await asyncio.sleep(0.5)
    return [task.id for task in tasks]


def test_finished_tasks_are_listed_newest_first_with_the_age_of_their_end(
    make_rover_world: MakeRoverWorld,
) -> None:
    world = make_rover_world()

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
