"""A real asyncio loop whose time is a world's: nothing sleeps, everything happens in its order."""

import asyncio
import signal
import socket
import sys
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import pytest

from mav_tasks.links.memory import Conditions, MemoryNet
from rover_sim.errors import NotInVirtualTime, Stalled
from rover_sim.testing.virtual_loop import VirtualLoop
from rover_sim.virtual import VirtualWorld

Run = Callable[[Coroutine[Any, Any, Any]], Any]


@pytest.fixture
def world() -> VirtualWorld:
    return VirtualWorld(MemoryNet(conditions=Conditions(delay=0.25)))


@pytest.fixture
def run(world: VirtualWorld) -> Iterator[Run]:
    loop = VirtualLoop(world)
    with asyncio.Runner(loop_factory=lambda: loop) as runner:

        def run_one(coroutine: Coroutine[Any, Any, Any]) -> Any:
            loop.allow(3600.0, real_seconds=30.0)
            return runner.run(coroutine)

        yield run_one
        loop.allow(10.0, real_seconds=10.0)


def test_asyncio_is_all_there(world: VirtualWorld, run: Run) -> None:
    async def late(value: int, after: float) -> int:
        await asyncio.sleep(after)
        return value

    async def all_of_it() -> None:
        assert list(await asyncio.gather(late(1, 2.0), late(2, 1.0))) == [1, 2]
        assert world.now == 2.0
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(asyncio.Event().wait(), 5.0)
        assert world.now == 7.0
        assert await asyncio.to_thread(sum, [1, 2]) == 3
        with pytest.raises(ZeroDivisionError):
            await asyncio.to_thread(lambda: 1 / 0)

    run(all_of_it())


async def opens_a_socket() -> None:
    await asyncio.get_running_loop().create_datagram_endpoint(
        asyncio.DatagramProtocol, remote_addr=("127.0.0.1", 14560)
    )


async def starts_a_process() -> None:
    await asyncio.create_subprocess_exec(sys.executable, "-c", "")


async def handles_a_signal() -> None:
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, print)


async def waits_for_a_descriptor() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as real:
        asyncio.get_running_loop().add_reader(real.fileno(), print)


def test_what_needs_real_time_is_refused(run: Run) -> None:
    for what in [
        opens_a_socket,
        starts_a_process,
        handles_a_signal,
        waits_for_a_descriptor,
    ]:
        with pytest.raises(NotInVirtualTime, match="virtual time"):
            run(what())


def test_nothing_due_anywhere_is_told_at_once(run: Run) -> None:
    async def patrol() -> None:
        await nobody_comes()

    async def nobody_comes() -> None:
        await asyncio.Event().wait()

    with pytest.raises(
        Stalled, match=r"deadlock: everything waits for something that never comes; at 0\.000 s"
    ) as told:
        run(patrol())
    text = str(told.value)
    assert text.index("patrol: await nobody_comes()") < text.index("await asyncio.Event().wait()")
    assert "test_virtual_loop.py" in text
