"""The client library over bad links and restarts of the server: what a script may rely on."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import timedelta
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
from mav_tasks.mavlink.messages import MissionAck
from mav_tasks.settings import Limits, Roles, Settings
from mav_tasks.store import MemoryStore
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld

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


@pytest.fixture
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


@pytest.mark.parametrize("seed", range(12))
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


@pytest.mark.parametrize("seed", range(6))
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


@pytest.mark.parametrize("seed", range(6))
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


@pytest.mark.parametrize(
    "goal",
    [Move(1e39), Drive(1.0, 0.0, 1e300), [Wait(1e39)], GoTo(LocalPlace(1, 1), speed=1e300)],
    ids=["command", "double", "plan", "speed"],
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


def test_a_rover_that_cannot_be_does_not_swallow_the_next_stop(world: RoverWorld) -> None:
    with world.sync_client() as client:
        with pytest.raises(ValueError, match="too large"):
            client.stop(vehicle=300)
        began = world.now
        client.stop()
        assert world.now - began < 0.6


@pytest.mark.parametrize("nonce", [-1, 2**30, 1.5])
def test_what_is_no_nonce_is_said_before_anything_is_sent(world: RoverWorld, nonce: Any) -> None:
    with world.sync_client() as client, pytest.raises(ValueError, match="nonce"):
        client.submit([Move(1.0)], nonce=nonce)
    assert not world.server.tasks


def copied(world: RoverWorld) -> None:
    """From now on let each packet come twice, the second one a little later."""
    world.lossy_link(duplication=1.0, jitter=0.05)


@pytest.mark.parametrize("seed", range(5))
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


@pytest.mark.parametrize("seed", range(5))
def test_a_copy_of_not_found_loses_no_task_that_is_there(make_world: MakeWorld, seed: int) -> None:
    world = make_world(seed=seed)

    async def script() -> None:
        async with world.client() as client:
            copied(world)
            task, told = await asyncio.gather(
                client.submit(short(1), delay=1.0), client.status(999), return_exceptions=True
            )
            assert isinstance(told, Refused)
            assert isinstance(task, Task)
            assert await end_of(task) is S.COMPLETED

    world.run(script())


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


def begin_anew(world: RoverWorld, *, next_id: int = 1) -> None:
    """Kill the server and start it on an empty store: its ids begin at 1 again, or later."""
    world.server.kill()
    world.server._store, world.server._server = MemoryStore(), None
    world.server._earlier = []
    world.server._is_killed = False
    world.server.start()
    assert world.server._server is not None
    world.server._server.engine._registry.restore((), next_id=next_id)


def test_handles_work_with_ids_above_what_a_float32_counts(world: RoverWorld) -> None:
    begin_anew(world, next_id=2**24 + 1)

    async def script() -> None:
        async with world.client() as client:
            await client.pause()
            first = await client.submit(Move(1.0))
            second = await client.submit(Move(1.0), after=first)
            third = await client.submit([Move(1.0), Wait(1.0)], after=second)
            assert [task.id for task in (first, second, third)] == [2**24 + n for n in (1, 2, 3)]
            assert [(await task.refresh()).after for task in (second, third)] == [
                first.id,
                second.id,
            ]
            await second.modify(priority=7, after=0)
            assert (await client.status(second.id)).priority == 7
            assert (await third.timing()).id == third.id
            await first.cancel()
            with pytest.raises(TaskFailed, match=f"task {first.id} cancelled"):
                await first.done()
            await client.resume()
            await second.done()

    world.run(script())


def test_after_the_store_was_lost_old_handles_end_and_new_ones_are_new(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            ended = await client.submit(short(1))
            await ended.done()
            lost = await client.submit(Move(5.0), delay=1000.0)
            assert (ended.id, lost.id) == (1, 2)
            waiting = asyncio.create_task(end_of(lost))
            await asyncio.sleep(0.1)
            begin_anew(world)
            await asyncio.sleep(4.0)
            began = world.now
            first, second = await client.submit(short(3)), await client.submit(short(4))
            assert world.now - began < 2.0
            assert (first.id, second.id) == (1, 2)
            assert first is not ended
            assert second is not lost
            assert await end_of(first) is await end_of(second) is S.COMPLETED
            assert await waiting is S.UNKNOWN

    world.run(script())


@pytest.mark.parametrize("name", ["done", "updates", "texts", "status", "done_later"])
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


def test_a_closed_client_sends_nothing_more(
    world: RoverWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[bytes] = []

    async def script() -> None:
        link = world.link()
        client = Client(link)
        async with client:
            world.server.kill()
            asking = asyncio.create_task(client.status(1))
            await asyncio.sleep(0.1)
        monkeypatch.setattr(link, "send", lambda _peer, data: sent.append(data))
        await asyncio.wait({asking})
        assert isinstance(asking.exception(), ClientError)
        await asyncio.sleep(5.0)

    world.run(script())
    assert not sent


def test_a_client_that_is_open_cannot_be_opened_again(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            with pytest.raises(MavTasksError, match="open already"):
                client.open()
            await client.submit(short(1))

    world.run(script())


def test_what_is_followed_does_not_grow_with_tasks_that_nobody_holds(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            kept = await client.submit(short(0), delay=1e6)
            for number in range(400):
                await client.submit(short(number), delay=1e6)
            assert len(client._open.session.watch._followed) < 200
            waiting = asyncio.create_task(end_of(kept))
            await asyncio.sleep(0.0)
            await client.clear()
            assert await waiting is S.CANCELLED

    world.run(script())


def test_no_answer_about_a_task_that_is_there_gives_its_nonce(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            original = client.modify

            async def lost(*a: Any, **kw: Any) -> None:
                with world.lossy_link(loss=1.0):
                    await original(*a, **kw)

            client.modify = lost  # type: ignore[method-assign]
            with pytest.raises(NoAnswer) as caught:
                await client.submit(short(1), deadline=50.0)
            client.modify = original  # type: ignore[method-assign]
            task = await client.submit(short(1), deadline=50.0, nonce=caught.value.nonce)
            assert await end_of(task) is S.COMPLETED

    world.run(script())
    assert len(world.server.tasks) == 1


def test_a_start_at_a_time_of_day_can_be_submitted_again_with_its_nonce(
    world: RoverWorld,
) -> None:
    at = world.utc + timedelta(seconds=90)

    async def script() -> None:
        async with world.client() as client:
            with world.lossy_link(loss=1.0), pytest.raises(NoAnswer) as caught:
                await client.submit(short(1), at=at)
            first = await client.submit(short(1), at=at, nonce=caught.value.nonce)
            await asyncio.sleep(3.0)
            again = await client.submit(short(1), at=at, nonce=caught.value.nonce)
            assert again.id == first.id

    world.run(script())
    assert len(world.server.tasks) == 1


@pytest.mark.parametrize("away", [3.0, 30.0])
@pytest.mark.parametrize("restarted", [False, True])
def test_a_plan_whose_ack_is_lost_is_one_task_however_late_it_comes_again(
    world: RoverWorld, monkeypatch: pytest.MonkeyPatch, away: float, restarted: bool
) -> None:
    plan = [Move(0.1), Move(0.2)]
    link = world.link()
    whole = link.receive

    def without_acks(limit: int) -> list[tuple[Any, bytes]]:
        return [(peer, data) for peer, data in whole(limit) if data[7] != MissionAck.id]

    async def script() -> None:
        async with Client(link) as client:
            with monkeypatch.context() as patch:
                patch.setattr(link, "receive", without_acks)
                with pytest.raises(NoAnswer) as caught:
                    await client.submit(plan)
            await asyncio.sleep(away)
            if restarted:
                world.server.restart()
                await asyncio.sleep(3.0)
            nonce = caught.value.nonce
            another = await client.submit([Move(0.1), Move(0.3)])  # meant as another one
            task = await client.submit(plan, nonce=nonce)
            equal = await client.submit(plan)  # meant twice
            assert (task.id, another.id, equal.id) == (1, 2, 3)
            with pytest.raises(Refused, match="used for another task"):
                await client.submit([Move(0.5), Move(0.5)], nonce=nonce)

    world.run(script())
    assert len(world.server.tasks) == 3


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


@pytest.mark.parametrize("suspended", [False, True])
def test_a_queue_is_told_whole_while_a_task_runs(world: RoverWorld, suspended: bool) -> None:
    async def script() -> None:
        async with world.client() as client:
            running = await client.submit(Wait(100.0))
            await asyncio.sleep(3.0)
            if suspended:
                await (await client.submit(Wait(200.0))).modify(preemptive=True)
                await asyncio.sleep(1.0)
            assert running.status is not None
            assert running.status.state is (S.PAUSED if suspended else S.EXECUTING)
            ids = [(await client.submit(short(n), priority=0)).id for n in range(40)]
            asked_at = world.now
            queue = await client.queue()
            waiting = [task.id for task in queue.waiting if task.id in ids]
            assert waiting == ids
            assert queue.waiting_count == len(ids)
            assert world.now - asked_at < 0.5, "nothing was asked for twice"

    world.run(script())


def test_plans_that_nobody_waits_for_are_not_uploaded_later(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            plans = [[Move(0.1), Move(0.1)], [Move(0.2), Move(0.2)]]
            with world.lossy_link(loss=1.0), suppress(TimeoutError):
                async with asyncio.timeout(3.0):
                    await asyncio.gather(*map(client.submit, plans))
            await asyncio.sleep(20.0)
            assert len(world.server.tasks) <= 1  # the first was under way
            task = await client.submit(plans[1])
            assert await end_of(task) is S.COMPLETED

    world.run(script())


def test_who_submits_faster_than_he_may_only_waits(make_world: MakeWorld) -> None:
    limits = Limits(rate=2.0)  # of which ten may come at once
    world = make_world(settings=Settings(roles=Roles(safety=limits)))

    async def script() -> None:
        async with world.client() as client:
            active = asyncio.get_running_loop().time()
            tasks = [await client.submit(short(n)) for n in range(16)]
            assert asyncio.get_running_loop().time() - active > 2.0
            assert [task.id for task in tasks] == list(range(1, 17))

    world.run(script())


def test_a_label_is_shown_and_survives_a_crash(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            task = await client.submit(Wait(60.0), label="Hof Süd, gate 3")
            status = await task.refresh()
            assert status.label == "Hof Süd, gate 3"
            assert status.words.startswith("wait 60 s 'Hof Süd, gate 3': ")
            world.server.kill()
            world.server.start()
            await client.found()
            assert (await task.refresh()).label == "Hof Süd, gate 3"
            await task.modify(label="gate 4")
            assert (await task.refresh()).label == "gate 4"
            await task.modify(label="")
            assert (await task.refresh()).label == ""

    world.run(script())


def test_a_label_that_is_too_long_submits_no_task(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            with pytest.raises(ValueError, match="at most 24 bytes"):
                await client.submit(Wait(1.0), label="x" * 25)
            with pytest.raises(ValueError, match="at most 24 bytes"):
                await client.submit_mission([Wait(1.0)], label="x" * 25)
            assert (await client.queue()).waiting_count == 0

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


def test_a_series_by_a_cron_expression_survives_a_crash(world: RoverWorld) -> None:
    async def script() -> None:
        async with world.client() as client:
            text = "30 6 * * 1-5 Europe/Zurich"
            task = await client.submit([Wait(1.0), Move(0.2)], every=text, deadline=60.0)
            status = await task.refresh()
            assert (status.state, status.every, status.series) == (S.SCHEDULED, text, task.id)
            assert status.time_to_start is not None
            assert status.time_to_start < 4 * 86_400  # not that which bridges the submission
            world.server.kill()
            world.server.start()
            await client.found()
            assert (await task.refresh()).every == text
            await task.modify(every="0 * * * *")
            assert (await task.refresh()).time_to_start <= 3600  # type: ignore[operator]
            await task.modify(every=0)
            assert (await task.refresh()).every is None

    world.run(script())


@pytest.mark.parametrize(
    ("terms", "words"),
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


def test_a_repetition_that_the_server_refuses_leaves_no_task(
    world: RoverWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a server that is older, or has no data of that time zone."""
    monkeypatch.setattr(
        "mav_tasks.engine.commands.task_control.canonical", lambda text: int("no rule")
    )

    async def script() -> None:
        async with world.client() as client:
            with pytest.raises(Refused):
                await client.submit(Move(5.0), every="0 6 * * *")
            assert (await client.queue()).waiting_count == 0

    world.run(script())
