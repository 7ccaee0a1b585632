"""A real asyncio loop whose time is a world's: nothing sleeps, everything happens in its order."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import pytest

from mav_tasks.links.memory import Conditions, MemoryNet
from rover_sim.errors import NotInVirtualTime, Stalled
from rover_sim.testing import virtual_loop
from rover_sim.testing.virtual_loop import VirtualLoop
from rover_sim.virtual import VirtualWorld

Run = Callable[[Coroutine[Any, Any, Any]], Any]


class Beat:
    """A party that notes the time every second."""

    def __init__(self) -> None:
        self.at: list[float] = []

    def next_deadline(self) -> float:
        return len(self.at) + 1.0

    def turn(self, *, now: float) -> None:
        if now >= self.next_deadline():
            self.at.append(now)


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


def test_a_sleep_takes_virtual_time_and_no_other(world: VirtualWorld, run: Run) -> None:
    began = time.monotonic()
    run(asyncio.sleep(3000))
    assert world.now == 3000.0
    assert time.monotonic() - began < 3


def test_timers_and_parties_have_their_turns_in_order(world: VirtualWorld, run: Run) -> None:
    beat = Beat()
    world.join(beat)
    seen: list[tuple[float, int]] = []

    async def look() -> None:
        for _ in range(4):
            await asyncio.sleep(0.75)
            seen.append((world.now, len(beat.at)))

    run(look())
    assert beat.at == [1.0, 2.0, 3.0]
    assert seen == [(0.75, 0), (1.5, 1), (2.25, 2), (3.0, 3)]


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
        async with asyncio.timeout(1.0), asyncio.TaskGroup() as group:
            done = [group.create_task(late(n, 0.5)) for n in range(3)]
        assert [task.result() for task in done] == [0, 1, 2]
        assert await asyncio.to_thread(sum, [1, 2]) == 3
        with pytest.raises(ZeroDivisionError):
            await asyncio.to_thread(lambda: 1 / 0)
        assert world.now == 7.5

    run(all_of_it())


def test_a_reader_is_called_when_something_has_arrived(world: VirtualWorld, run: Run) -> None:
    here, there = world.net.link("here"), world.net.link("there")
    assert here.fileno() != there.fileno()
    got: list[tuple[float, list[Any]]] = []

    async def listen() -> None:
        loop = asyncio.get_running_loop()
        loop.add_reader(here.fileno(), lambda: got.append((loop.time(), here.receive(64))))
        there.send("here", b"one")
        await asyncio.sleep(1.0)
        there.send("here", b"two")
        await asyncio.sleep(1.0)
        assert loop.remove_reader(here.fileno())
        there.send("here", b"three")
        await asyncio.sleep(1.0)

    run(listen())
    assert got == [(0.25, [("there", b"one")]), (1.25, [("there", b"two")])]
    assert here.receive(64) == [("there", b"three")]


def test_a_task_left_behind_goes_on_in_the_next_run(world: VirtualWorld, run: Run) -> None:
    woken: list[float] = []

    async def later() -> None:
        await asyncio.sleep(5.0)
        woken.append(world.now)

    async def begin() -> asyncio.Task[None]:
        return asyncio.create_task(later())

    task = run(begin())
    run(asyncio.sleep(4.0))
    assert woken == []
    run(asyncio.sleep(4.0))
    assert (woken, task.done()) == ([5.0], True)


async def opens_a_socket() -> None:
    await asyncio.get_running_loop().create_datagram_endpoint(
        asyncio.DatagramProtocol, remote_addr=("127.0.0.1", 14560)
    )


async def connects() -> None:
    await asyncio.open_connection("127.0.0.1", 5760)


async def starts_a_process() -> None:
    await asyncio.create_subprocess_exec(sys.executable, "-c", "")


async def asks_for_a_name() -> None:
    await asyncio.get_running_loop().getaddrinfo("localhost", 80)


async def handles_a_signal() -> None:
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, print)


async def waits_for_a_descriptor() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as real:
        asyncio.get_running_loop().add_reader(real.fileno(), print)


@pytest.mark.parametrize(
    "what",
    [
        opens_a_socket,
        connects,
        starts_a_process,
        asks_for_a_name,
        handles_a_signal,
        waits_for_a_descriptor,
    ],
)
def test_what_needs_real_time_is_refused(
    run: Run, what: Callable[[], Coroutine[Any, Any, None]]
) -> None:
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


def test_waiting_beyond_the_limit_is_told(world: VirtualWorld, run: Run) -> None:
    world.join(Beat())
    with pytest.raises(Stalled, match=r"not over within 3600 s of virtual time; at 3600\.000 s"):
        run(asyncio.Event().wait())
    run(asyncio.sleep(10))  # each run has all of it again
    assert world.now == 3610.0


def test_waiting_beyond_the_limit_of_real_time_is_told(world: VirtualWorld) -> None:
    world.join(Beat())
    loop = VirtualLoop(world)
    loop.allow(1e12, real_seconds=0.05)
    try:
        with pytest.raises(Stalled, match=r"not over within 0\.05 s of real time"):
            loop.run_until_complete(asyncio.sleep(1e11))
        loop.allow(1.0, real_seconds=10.0)
        for task in asyncio.all_tasks(loop):
            task.cancel()
        loop.run_until_complete(asyncio.sleep(0))
    finally:
        loop.close()


def test_a_loop_without_time_is_told(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual_loop, "MOST_TURNS", 1000)

    async def spin() -> None:
        for _ in range(1_000_000):
            await asyncio.sleep(0)

    with pytest.raises(Stalled, match="1000 times and no time passed"):
        run(spin())


def test_a_reader_that_does_not_read_is_told(
    world: VirtualWorld, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(virtual_loop, "MOST_TURNS", 1000)
    here = world.net.link("here")

    async def ignore() -> None:
        asyncio.get_running_loop().add_reader(here.fileno(), lambda: None)
        here.send("here", b"one")
        await asyncio.sleep(1.0)

    with pytest.raises(Stalled, match="1000 times and no time passed"):
        run(ignore())


def test_ctrl_c_ends_a_long_drive(world: VirtualWorld, run: Run) -> None:
    world.join(Beat())
    ended: list[str] = []

    async def drive() -> None:
        try:
            asyncio.get_running_loop().call_later(100, os.kill, os.getpid(), signal.SIGINT)
            await asyncio.sleep(3000)
        finally:
            ended.append("orderly")

    assert threading.current_thread() is threading.main_thread()
    with pytest.raises(KeyboardInterrupt):
        run(drive())
    assert ended == ["orderly"]
    assert world.now < 110


def test_no_descriptor_is_as_high_as_a_link_s_number(world: VirtualWorld) -> None:
    number = world.net.link("here").fileno()
    with pytest.raises(OverflowError):  # it does not even fit into what the kernel is asked
        os.fstat(number)


def test_closing_leaves_nothing_behind() -> None:
    """Warnings of interpreters that close: what is still open, or never awaited."""
    code = """
        import asyncio
        from mav_tasks.links.memory import MemoryNet
        from rover_sim.testing.virtual_loop import VirtualLoop
        from rover_sim.virtual import VirtualWorld

        async def main():
            tasks.append(asyncio.create_task(asyncio.sleep(50)))
            await asyncio.sleep(1)

        tasks = []
        loop = VirtualLoop(VirtualWorld(MemoryNet()))
        loop.allow(100, real_seconds=10)
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(main())
        assert tasks[0].cancelled()
    """
    done = subprocess.run(
        [sys.executable, "-X", "dev", "-W", "error", "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
