"""The client library over bad links and restarts of the server: what a script may rely on."""

import asyncio
from contextlib import suppress
from random import Random
from typing import Any

import pytest

from mav_tasks import (
    Client,
    Drive,
    Move,
    NoAnswer,
    Refused,
    Task,
    TaskFailed,
    TaskReason,
    TaskState,
    Wait,
)
from mav_tasks.basics.errors import ClientError, MavTasksError
from mav_tasks.plans import GeoPoint, PlanFile
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.store import MemoryStore
from mav_tasks.tasks.restored import Restored
from rover_sim.testing.rover_world import RoverWorld
from rover_sim.testing.virtual_loop import VirtualLoop
from tests.kit.cases import anew
from tests.scenarios.conftest import MakeRoverWorld, MakeWorld

S = TaskState
RALLY = PlanFile((), None, (), (GeoPoint(-353_632_000, 1_491_652_000, 0.0),))
EVER = 400.0  # s, in which a handle must have learned how its task ended


@anew
def world(make_rover_world: MakeRoverWorld) -> RoverWorld:
    """Return a world with one rover."""
    return make_rover_world()


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
def test_each_submission_is_one_task_over_a_bad_link(
    make_rover_world: MakeRoverWorld, seed: int
) -> None:
    world = make_rover_world(seed=seed)
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


def test_a_busy_reader_of_updates_is_told_the_end_too(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            task = await client.submit(Move(0.5))
            seen = []
            async for status in task.updates():
                seen.append(status.state)
                if status.state is S.EXECUTING:
                    await task.done()
            assert seen[-2:] == [S.EXECUTING, S.COMPLETED]

    world.run(script())


@pytest.mark.parametrize("seed", range(3))
def test_every_handle_learns_its_end_when_the_server_is_killed(
    make_rover_world: MakeRoverWorld, seed: int
) -> None:
    world = make_rover_world(seed=seed)
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


def test_what_a_script_stopped_waiting_for_is_not_submitted_later(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            with world.lossy_link(loss=1.0), pytest.raises(TimeoutError):
                async with asyncio.timeout(1.0):
                    await asyncio.gather(client.submit(Move(1.0)), client.submit(Move(2.0)))
            await asyncio.sleep(20.0)

    world.run(script())
    assert not world.server.tasks


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


def test_without_an_answer_each_call_says_so_and_a_closed_client_ends_all(
    world: RoverWorld,
) -> None:
    goals: Any = [Move(0.3), Wait(2.0)]

    async def script() -> None:
        async with world.client() as client, world.client() as other:
            with pytest.raises(MavTasksError, match="open already"):
                client.open()
            await client.pause()
            task = await client.submit(Move(1.0), label="before")
            with pytest.raises(NoAnswer, match="no parameter TSK_NOTHING"):
                await client.parameter("TSK_NOTHING")
            with pytest.raises(Refused, match="no task is running"):
                await client.cancel()
            with world.lossy_link(loss=1.0):
                calls: list[Any] = [
                    client.queue(),
                    client.history(),
                    client.timing(),
                    client.mission(),
                    client.parameter("TSK_SPEED"),
                    client.submit(goals),
                    client.set_rally_points(RALLY),
                    client.submit(Move(1.0)),
                    client.submit(Move(1.0), vehicle="any"),
                    task.modify(label="after"),
                    task.refresh(),
                    client.stop(within=1.0),
                    client.resume(),
                ]
                ends = await asyncio.gather(*calls, return_exceptions=True)
            for end in ends:
                assert isinstance(end, NoAnswer)
                assert "answer" in str(end)
            # both ends of a long way: plans of one client and of two take turns
            with world.lossy_link(delay=0.15):
                asked = (each.submit(goals) for each in (client, client, other))
                tasks = await asyncio.gather(*asked)
                await task.modify(label="a long label of a task")
                await client.stage_mission(goals)
            assert len({each.id for each in tasks}) == 3
            assert (await task.refresh()).label == "a long label of a task"
            with world.lossy_link(loss=0.2, jitter=0.9, duplication=0.5):
                for number in range(4):
                    label = f"a long label of task {number:02}"
                    with suppress(ClientError):
                        await task.modify(label=label)
                        assert world.server.task(task.id).terms.label == label
            with world.lossy_link(loss=0.35, duplication=0.5):
                assert len(await client.mission()) == 3, "with home"
                assert await client.set_rally_points(RALLY) == 1
                assert len(await client.rally_points()) == 1
            with world.lossy_link(loss=1.0), pytest.raises(TimeoutError):
                async with asyncio.timeout(5.0):
                    await asyncio.gather(client.submit(goals), client.submit(goals))
            await asyncio.sleep(5.0)
            assert (await client.queue()).waiting_count == 6, "one was on its way"
            texts = client.texts()
            waiting: list[Any] = [
                task.done(),
                anext(aiter(task.updates())),
                client.found(),
                anext(texts),
            ]
            waiting += [client.queue(), client.mission(), task.refresh()]
            running = [asyncio.ensure_future(each) for each in waiting]
            await asyncio.sleep(0.0)
            await client.close()
            ends = await asyncio.gather(*running, return_exceptions=True)
            assert [str(end) for end in ends if isinstance(end, ClientError)] == [
                "the client was closed"
            ] * 5
            for call, words in ((client.queue(), "open it first"), (task.done(), "was closed")):
                with pytest.raises(MavTasksError, match=words):
                    await call

    world.run(script())


def test_tasks_that_a_new_server_does_not_know_are_lost(make_world: MakeWorld) -> None:
    world = make_world()
    loop = VirtualLoop(world)
    loop.allow(60.0, real_seconds=60.0)

    async def script() -> None:
        async with Client(world.net.link("script", peers=(CLIENT_LINK,))) as client:
            tasks = [await client.submit(Move(1.0), delay=600.0) for _ in range(2)]
            world.end_server()
            world.start_server(MemoryStore(), Restored())
            await asyncio.sleep(5.0)
            assert (await client.submit(Move(2.0), delay=600.0)).id == tasks[0].id
            for task in tasks:
                with pytest.raises(TaskFailed, match=f"task {task.id}: the server no longer knows"):
                    await task.done()

    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        runner.run(script())
