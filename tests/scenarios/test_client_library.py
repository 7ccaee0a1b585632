"""The client library over bad links and restarts of the server: what a script may rely on."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import suppress
from random import Random
from typing import Any

import pytest

from mav_tasks import (
    Client,
    Drive,
    GoTo,
    LocalPlace,
    Move,
    NoAnswer,
    Refused,
    Task,
    TaskFailed,
    TaskReason,
    TaskState,
    Wait,
)
from mav_tasks.errors import ClientError, MavTasksError
from mav_tasks.settings import Settings
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld
from tests.kit.cases import anew, for_each

MakeWorld = Callable[..., RoverWorld]
S = TaskState
EVER = 400.0  # s, in which a handle must have learned how its task ended


@pytest.fixture
def make_world() -> Iterator[MakeWorld]:
    """Return a factory of worlds with a server that is ready."""
    worlds: list[RoverWorld] = []

    def make(*, seed: int = 1, settings: Settings | None = None, **options: Any) -> RoverWorld:
        world = RoverWorld(RoverOptions(**options), seed=seed, settings=settings or Settings())
        worlds.append(world)
        world.server.start()
        world.until(lambda: world.server.is_ready)
        return world

    yield make
    for world in worlds:
        world.close()


@anew
def world(make_world: MakeWorld) -> RoverWorld:
    """Return a world with one rover."""
    return make_world()


async def submit_until_it_is_taken(client: Client, goal: Any) -> Task:
    """Submit as README says that one does over a bad link: again, with the nonce."""
    nonce = 0
    while True:
        try:
            return await client.submit(goal, nonce=nonce)
        except NoAnswer as error:
            nonce = error.nonce
            assert nonce, "submitted again without it, it could be another task"


async def end_of(task: Task) -> TaskState:
    """Wait for a task's end, whichever it is."""
    async with asyncio.timeout(EVER):
        try:
            return (await task.done()).state
        except TaskFailed as failed:
            return TaskState(failed.state)


def short(number: int) -> Drive:
    """Return a goal that is told from all others by its duration."""
    return Drive(0.0, 0.5, 0.05 + number / 1000)


@pytest.mark.parametrize("seed", range(4))
def test_each_submission_is_one_task_over_a_bad_link(make_world: MakeWorld, seed: int) -> None:
    world = make_world(seed=seed)
    random = Random(seed)
    count = 8

    async def script() -> None:
        async with world.client() as client:
            world.lossy_link(
                loss=random.uniform(0, 0.4),
                duplication=random.uniform(0, 0.4),
                jitter=random.uniform(0, 0.3),
            )
            goals = [short(n) for n in range(count)]
            tasks = await asyncio.gather(*(submit_until_it_is_taken(client, g) for g in goals))
            for goal, task in zip(goals, tasks, strict=True):
                driven: Any = world.server.task(task.id).goal
                assert driven.duration == pytest.approx(goal.duration)
            assert set(await asyncio.gather(*map(end_of, tasks))) == {S.COMPLETED}

    world.run(script())
    assert len(world.server.tasks) == count


@pytest.mark.parametrize("seed", range(3))
def test_each_plan_is_one_task_over_a_bad_link(make_world: MakeWorld, seed: int) -> None:
    world = make_world(seed=seed)
    random = Random(seed)
    count = 4

    async def script() -> None:
        async with world.client() as client:
            world.lossy_link(
                loss=random.uniform(0, 0.25),
                duplication=random.uniform(0, 0.4),
                jitter=random.uniform(0, 0.2),
            )
            plans = [[Move(0.01)] * (n % 2 + 2) for n in range(count)]
            tasks = await asyncio.gather(*(submit_until_it_is_taken(client, p) for p in plans))
            assert len({task.id for task in tasks}) == count
            for plan, task in zip(plans, tasks, strict=True):
                stored: Any = world.server.task(task.id).goal
                assert len(stored.steps) == len(plan) + 1  # and the terms

    world.run(script())
    assert len(world.server.tasks) == count


@pytest.mark.parametrize("seed", range(3))
def test_every_handle_learns_its_end_when_the_server_is_killed(
    make_world: MakeWorld, seed: int
) -> None:
    world = make_world(seed=seed)
    random = Random(seed)

    async def trouble() -> None:
        for _ in range(3):
            await asyncio.sleep(random.uniform(0.0, 6.0))
            world.server.kill()
            await asyncio.sleep(random.choice([0.1, 1.0, 4.0, 30.0]))
            world.server.start()
        await asyncio.sleep(8.0)
        world.lossy_link.mend()

    async def operate(client: Client, tasks: list[Task]) -> None:
        """Go on after each restart; what is held is driven again."""
        while not all(task.status is not None and task.status.is_over for task in tasks):
            await asyncio.sleep(1.0)
            for task in tasks:
                if task.status is not None and task.status.reason is TaskReason.WRONG_MODE:
                    world.rovers[0].set_mode("hold")  # it was left in GUIDED for a long time
                if task.status is not None and task.status.state is S.HELD:
                    with suppress(ClientError):
                        await task.release("skip")
            with suppress(ClientError):
                await client.resume()

    async def script() -> None:
        async with world.client() as client:
            world.lossy_link(loss=0.2, duplication=0.2, jitter=0.1)
            troubles = asyncio.create_task(trouble())
            goals = [Move(0.5), short(1), Move(0.3), short(2)]
            tasks = [await submit_until_it_is_taken(client, goal) for goal in goals]
            ends = [asyncio.create_task(end_of(task)) for task in tasks]
            await troubles
            operating = asyncio.create_task(operate(client, tasks))
            told = await asyncio.gather(*ends)
            operating.cancel()
            assert told == [world.server.task(task.id).state for task in tasks]

    world.run(script())
    assert len(world.server.tasks) == 4


@for_each(
    "goal", [Move(1e39), Drive(1.0, 0.0, 1e300), [Wait(1e39)], GoTo(LocalPlace(1, 1), speed=1e300)]
)
def test_a_number_that_cannot_be_sent_is_said_and_hurts_nothing_else(
    world: RoverWorld, goal: Any
) -> None:
    with world.sync_client() as client:
        with pytest.raises(ValueError, match="too large to send"):
            client.submit(goal)
        began = world.now
        client.submit(short(1))
        assert world.now - began < 0.1
    assert len(world.server.tasks) == 1


def copied(world: RoverWorld) -> None:
    """From now on let each packet come twice, the second one a little later."""
    world.lossy_link(duplication=1.0, jitter=0.05)


@pytest.mark.parametrize("seed", range(2))
def test_a_refusals_copy_does_not_refuse_what_is_submitted_beside_it(
    make_world: MakeWorld, seed: int
) -> None:
    world = make_world(seed=seed)

    async def script() -> None:
        async with world.client() as client:
            copied(world)
            goals = [Drive(0.0, 0.0, 1.0), short(1), short(2)]
            told = await asyncio.gather(*map(client.submit, goals), return_exceptions=True)
            assert [type(each) for each in told] == [Refused, Task, Task]

    world.run(script())
    assert len(world.server.tasks) == 2


def test_what_a_script_stopped_waiting_for_is_not_submitted_later(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            with world.lossy_link(loss=1.0), pytest.raises(TimeoutError):
                async with asyncio.timeout(1.0):
                    await asyncio.gather(client.submit(Move(1.0)), client.submit(Move(2.0)))
            await asyncio.sleep(20.0)

    world.run(script())
    assert not world.server.tasks


def test_where_nobody_answers_all_are_told_in_time(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            world.server.kill()
            began = world.now
            asked = [client.submit(short(n)) for n in range(10)]
            told = await asyncio.gather(*asked, return_exceptions=True)
            assert {type(each) for each in told} == {NoAnswer}
            assert len({each.nonce for each in told if isinstance(each, NoAnswer)}) == 10
            assert world.now - began == pytest.approx(10.0, abs=0.1)

    world.run(script())


def test_a_stop_goes_out_at_once_and_no_earlier_resume_undoes_it(world: RoverWorld) -> None:
    (rover,) = world.rovers

    async def script() -> None:
        async with world.client() as client:
            await client.submit(Move(20.0))
            await asyncio.sleep(6.0)
            await client.stop()
            await client.resume()
            await client.stop()
            with world.lossy_link(loss=1.0):
                resuming = asyncio.create_task(client.resume())
                await asyncio.sleep(0.1)
            began = world.now
            stopping = asyncio.create_task(client.stop())
            await asyncio.sleep(0.05)
            assert rover.mode == "hold"
            await stopping
            assert world.now - began < 1.0
            with pytest.raises(ClientError, match="a later STOP or pause overtook"):
                await resuming
            await asyncio.sleep(5.0)
            assert rover.stands
            assert rover.mode == "hold"

    world.run(script())


def test_a_resume_undoes_no_halt_that_came_since_what_was_seen(world: RoverWorld) -> None:
    """Attack D1: its copies go on for 10 s, and a person pauses in between."""

    async def script() -> None:
        async with world.client() as client, world.client() as person:
            await client.submit(Move(20.0))
            await asyncio.sleep(4.0)
            await client.pause()
            seen = await client.queue()
            await person.pause()
            with pytest.raises(Refused, match="since you read the status") as refused:
                await client.resume(epoch=seen.halt_epoch)
            assert refused.value.reason == TaskReason.STALE
            with world.lossy_link(loss=0.3, delay=1.0):
                resuming = asyncio.create_task(client.resume())
                await asyncio.sleep(4.0)
                await person.stop()
                with suppress(MavTasksError):
                    await resuming
            await asyncio.sleep(15.0)
            assert world.rovers[0].stands
            assert (await person.queue()).paused is TaskReason.STOPPED
            await person.resume()
            assert (await person.queue()).paused is None

    world.run(script())


@for_each("name", ["done", "updates", "texts", "status", "done_later"])
def test_whoever_waits_is_told_when_the_client_is_closed(world: RoverWorld, name: str) -> None:
    async def script() -> None:
        async with world.client() as client:
            task = await client.submit(Move(5.0), delay=1000.0)
            if name == "status":
                world.server.kill()
            waiting = asyncio.create_task(wait(client, task))
            await asyncio.sleep(2.5)
        if name == "done_later":
            waiting = asyncio.create_task(wait(client, task))
        async with asyncio.timeout(1.0):
            with pytest.raises(ClientError, match="closed"):
                await waiting

    async def wait(client: Client, task: Task) -> None:
        match name:
            case "updates":
                async for _ in task.updates():
                    pass
            case "texts":
                async for _ in client.texts():
                    pass
            case "status":
                await client.status(task.id)
            case _:
                await task.done()

    world.run(script())


@pytest.mark.parametrize("seed", range(2))
def test_a_queue_is_told_whole_and_in_its_order_over_a_bad_link(
    make_world: MakeWorld, seed: int
) -> None:
    world = make_world(seed=seed)

    async def script() -> None:
        async with world.client() as client:
            await client.pause()
            ids = [(await client.submit(short(n))).id for n in range(40)]
            world.lossy_link(loss=0.2, duplication=0.2, jitter=0.05)
            queue = await client.queue()
            assert [task.id for task in queue.waiting] == ids

    world.run(script())


def test_a_task_that_repeats_is_followed_and_ended_through_the_library(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            task = await client.submit(Move(0.2), every=30.0, deadline=20.0, label="round")
            await task.done()
            assert task.series == task.id
            (status,) = (await client.queue()).waiting
            assert (status.series, status.every, status.label) == (task.id, 30, "round")
            assert status.time_to_start == pytest.approx(30, abs=8)
            run = await client.task(status.id)
            await run.done()
            await run.refresh()
            (following,) = (await client.queue()).waiting
            assert await client.cancel(task.id, series=True) == following.id
            assert (await client.queue()).waiting_count == 0
            with pytest.raises(Refused, match="does not repeat"):
                await run.cancel(series=True)

    world.run(script())


@for_each(
    "terms, words",
    [
        ({"every": 5.0}, "expected 10 s"),
        ({"every": 10.5}, "whole seconds"),
        ({"every": "61 * * * *"}, "bad minute"),
        ({"every": "0 6 * * * Mars/X"}, "time zone"),
        ({"every": "0 6 * * *", "delay": 5.0}, "names the start times"),
    ],
)
def test_an_invalid_repetition_submits_no_task(
    world: RoverWorld, terms: dict[str, Any], words: str
) -> None:
    async def script() -> None:
        async with world.client() as client:
            with pytest.raises(ValueError, match=words):
                await client.submit(Move(0.2), **terms)
            assert (await client.queue()).waiting_count == 0

    world.run(script())
