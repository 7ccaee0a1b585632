"""The client library against a real server and rover: what a script author relies on."""

import asyncio
from collections.abc import Iterator
from math import radians
from socket import AF_INET, SOCK_DGRAM, socket

import pytest

from mav_tasks import (
    Client,
    GoTo,
    LocalPlace,
    Move,
    NoAnswer,
    QueueStatus,
    Rotate,
    SyncClient,
    TaskFailed,
    TaskState,
    TaskStatus,
    Text,
    Wait,
)
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Heartbeat
from tests.kit.awaited import awaited
from tests.kit.processes import Stand, free_udp_ports, stand

S = TaskState
CLIENTS = 50

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    """One server and rover for all of them; each leaves the queue empty."""
    with stand(tmp_path_factory.mktemp("client")) as it:
        yield it


def url(it: Stand) -> str:
    return f"udpout:127.0.0.1:{it.client_port}"


@awaited
async def test_a_script_submits_watches_and_awaits(running: Stand) -> None:
    async with Client(url(running)) as tasks:
        (rover,) = tasks.vehicles()
        assert (rover.id, rover.kind, rover.server_component) == (1, "ardupilot", 191)

        first = await tasks.submit(Move(0.8), priority=3)
        async for status in first.updates(interval=0.1):
            if status.state is S.EXECUTING:
                break
        turn = await tasks.submit(Rotate(radians(30)), priority=8)
        way = await tasks.submit([GoTo(LocalPlace(0.0, 0.0), radius=0.3), Wait(0.3)], after=turn)

        queue = await tasks.queue()
        assert (queue.running, queue.waiting_count) == (first.id, 2)
        assert [(t.id, t.state) for t in queue.waiting] == [
            (turn.id, S.QUEUED),
            (way.id, S.BLOCKED),
        ]
        seen = [status async for status in first.updates(interval=0.1)]
        shares = [status.progress or 0.0 for status in seen]
        assert shares == sorted(shares)
        assert len(set(shares)) > 4
        assert seen[-1].state is S.COMPLETED
        assert (await turn.done()).state is S.COMPLETED
        done = await way.done()
        assert (done.item, done.items) == (2, 2)
        assert (done.execution_time or 0.0) > 0.3


@awaited
async def test_a_listener_hears_of_rovers_tasks_and_texts(running: Stand) -> None:
    async with Client(url(running), telemetry_rate=5) as tasks:
        heard: list[object] = []
        with tasks.listening(heard.append):
            done = await (await tasks.submit(Move(0.3), label="heard")).done()
            await tasks.queue()
        states = [n.state for n in heard if isinstance(n, TaskStatus) and n.id == done.id]
        assert S.EXECUTING in states
        assert states[-1] is S.COMPLETED
        assert "VehicleChanged(vehicle=1)" in map(repr, heard)
        assert any(isinstance(n, Text) and f"Task {done.id}" in n.words for n in heard)
        assert any(isinstance(n, QueueStatus) and n.vehicle == 1 for n in heard)
        (rover,) = tasks.vehicles()
        assert rover.position_age is not None
        assert (rover.battery, rover.is_ready) != (None, None)
        assert (rover.latitude, rover.longitude) != (None, None)
        count = len(heard)
        await tasks.queue()
        assert len(heard) == count


@awaited
async def test_fifty_clients_each_learn_of_their_own(running: Stand) -> None:
    async def one(number: int) -> tuple[int, int]:
        async with Client(url(running), timeout=20.0) as tasks:
            task = await tasks.submit(Move(1.0 + number), delay=600.0)
            told = (await task.refresh()).remaining
            assert told == pytest.approx(1.0 + number)
            await task.cancel()
            with pytest.raises(TaskFailed) as ended:
                await task.done()
            return ended.value.task_id, task.id

    ended = await asyncio.gather(*(one(number) for number in range(CLIENTS)))
    assert all(told == own for told, own in ended)
    assert len({own for _, own in ended}) == CLIENTS


def test_the_same_without_asyncio(running: Stand) -> None:
    with SyncClient(url(running)) as tasks:
        task = tasks.submit(Rotate(-0.3))
        progress = [status.progress for status in task.updates(interval=0.1)]
        assert progress[-1] == 1.0
        assert task.done(timeout=1.0).state is S.COMPLETED
        later = tasks.submit(Move(1.0), delay=600.0)
        words = rf"task {later.id} has not ended after 0.2 s: move 1 m: scheduled \(start time\)"
        with pytest.raises(TimeoutError, match=words):
            later.done(timeout=0.2)
        assert tasks.queue().waiting_count == 1
        tasks.clear()
        with pytest.raises(TaskFailed, match="cleared"):
            later.done(timeout=5.0)
        assert [rover.id for rover in tasks.vehicles()] == [1]
        soon = tasks.submit(Rotate(0.1), delay=0.5)
        words = f"Task {soon.id} started"
        assert next(text.vehicle for text in tasks.texts() if text.words == words) == 1
        soon.done(timeout=10.0)


@awaited
async def test_another_server_that_sends_to_its_port_is_neither_heard_nor_sent_anything() -> None:
    """An earlier client had the port, and its server goes on sending: that got our commands."""
    beat = Encoder(Address(1, 1)).encode(Heartbeat(0, 10, 3, 128, 4, 3))
    (port,) = free_udp_ports(1)
    with socket(AF_INET, SOCK_DGRAM) as ours, socket(AF_INET, SOCK_DGRAM) as other:
        ours.bind(("127.0.0.1", port))
        other.setblocking(False)

        async def other_speaks() -> None:
            _, client = await asyncio.to_thread(ours.recvfrom, 1000)
            while True:
                other.sendto(beat, client)
                await asyncio.sleep(0.1)

        speaks = asyncio.create_task(other_speaks())
        with pytest.raises(NoAnswer, match="no task server answered"):
            await Client(f"udpout:127.0.0.1:{port}", timeout=2.5).__aenter__()
        speaks.cancel()
        with pytest.raises(BlockingIOError):
            other.recvfrom(1000)


@awaited
async def test_a_rover_without_a_task_server_is_told_apart(running: Stand) -> None:
    with pytest.raises(NoAnswer, match=r"rover 1 is heard on .*, but no task server answered"):
        async with Client(f"udpout:127.0.0.1:{running.rover_port}", timeout=2.5):
            pass
