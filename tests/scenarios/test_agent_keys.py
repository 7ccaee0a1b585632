"""An agent's idempotency keys: for how long, and for what, a key is one task; in virtual time."""

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest

from mav_tasks import TaskStatus
from mav_tasks.agents import submission
from mav_tasks.agents.durable import Durable
from mav_tasks.agents.rovers import Rovers
from mav_tasks.agents.submission import Wish
from mav_tasks.basics.errors import Refused, UsageError
from rover_sim.testing.rover_world import RoverWorld
from tests.scenarios.conftest import MakeRoverWorld

NONCE_KEPT = 600.0  # s, in which the server knows a task by its nonce

MOVE = {"kind": "move", "distance": 0.5}
TERMS = dict.fromkeys(("priority", "after", "start_in", "deadline", "label"))


@pytest.fixture
def world(make_rover_world: MakeRoverWorld) -> RoverWorld:
    """Return a rover and a server that is ready."""
    return make_rover_world()


@asynccontextmanager
async def agent(world: RoverWorld) -> AsyncIterator[Rovers]:
    """Yield the rovers of one life of an agent."""
    async with world.client() as client:
        yield Rovers(client, only=None)


def submitted(rovers: Rovers, key: str, **other: Any) -> Coroutine[Any, Any, TaskStatus]:
    """Submit a move, with other content if some is named."""
    values = {"goals": [MOVE], "idempotency_key": key, **TERMS, **other}
    return submission.submit(rovers, Wish.of(1, values))


async def driven(rovers: Rovers, key: str) -> TaskStatus:
    """Submit a task and wait for its end."""
    task = await rovers.task((await submitted(rovers, key)).id)
    return await task.done()


def test_a_key_is_one_task_until_the_server_forgets_it_and_is_refused_from_then_on(
    world: RoverWorld,
) -> None:
    async def script() -> None:
        async with agent(world) as rovers:
            first = await driven(rovers, "once")
            north = world.rovers[0].north
        await asyncio.sleep(NONCE_KEPT - 2 * submission.MARGIN)
        async with agent(world) as rovers:
            assert (await submitted(rovers, "once")).id == first.id
            with pytest.raises(Refused, match="'once': it was used for another task"):
                await submitted(rovers, "once", priority=9)
        for later in (submission.MARGIN, NONCE_KEPT):
            await asyncio.sleep(later)
            async with agent(world) as rovers:
                with pytest.raises(UsageError, match=f"'once': it was task {first.id}, completed"):
                    await submitted(rovers, "once")
        assert world.rovers[0].north == pytest.approx(north, abs=0.01)
        async with agent(world) as rovers:
            assert (await driven(rovers, "twice")).id != first.id

    world.run(script())


def test_a_task_of_the_protocol_is_cancelled_once_and_only_by_its_whole_id(
    world: RoverWorld,
) -> None:
    async def script() -> None:
        async with agent(world) as rovers:
            durable = Durable(rovers)
            task_id = durable.created(await submitted(rovers, "later", start_in=900))["taskId"]
            for wrong in ("1", "1-99-1", f"{task_id[:4]}1"):
                with pytest.raises(Refused, match="no task"):
                    await durable.cancel(wrong)
            for _ in range(2):
                await durable.cancel(task_id)
                assert (await durable.get(task_id))["status"] == "cancelled"

    world.run(script())
