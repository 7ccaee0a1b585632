"""What the runner makes of time in which it did not run, or in which the machine was asleep.

The clock is shifted under it, as that of a machine that wakes up; the loop's own does not see that.
"""

import asyncio
import os
import signal
import socket
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack
from math import inf
from time import sleep
from types import NoneType

import pytest

from mav_tasks.clock import boot_time
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import AtOnce, Packets, Peer
from mav_tasks.links.base import Link, PeerChange, PeerState
from mav_tasks.links.udp import UdpLink, UdpUrl
from mav_tasks.runner import Runner
from mav_tasks.settings import Settings
from mav_tasks.store import MemoryStore
from tests.unit.test_runner import FakeStream

pytestmark = pytest.mark.patches_core

ASLEEP = 20.0  # s
STOOD = 0.4  # s, in which the loop does not run
HOST = "127.0.0.1"


class Noting(Engine):
    """An engine that keeps what comes in, and when; nothing is due unless a test says so."""

    def __init__(self) -> None:
        super().__init__(Settings(), now=boot_time())
        self.inputs: list[tuple[float, object]] = []
        self.due = inf

    def handle(self, item: object, *, now: float) -> None:
        self.inputs.append((now, item))

    def handle_deadline(self, *, now: float) -> None:
        self.inputs.append((now, None))

    def next_deadline(self) -> float:
        return self.due

    def take(self, *kinds: type) -> list[object]:
        """Return the inputs of these kinds, each once."""
        found = [item for _, item in self.inputs if isinstance(item, kinds)]
        self.inputs = [each for each in self.inputs if not isinstance(each[1], kinds)]
        return found


class Bench:
    """A runner with a clock that can be shifted."""

    def __init__(self, *, clients: list[Link], vehicles: list[Link]) -> None:
        self.shift = 0.0
        self.engine = Noting()
        self.runner = Runner(
            self.engine,
            MemoryStore(),
            clients=clients,
            vehicles=vehicles,
            clock=lambda: boot_time() + self.shift,
        )

    def run(self, script: Callable[[], Awaitable[None]]) -> None:
        async def run() -> None:
            running = asyncio.create_task(self.runner.run())
            await asyncio.sleep(0)
            await script()
            for _ in range(2):  # the second leaves at once: this engine never ends in order
                os.kill(os.getpid(), signal.SIGTERM)
                await asyncio.sleep(0.02)
            await asyncio.wait_for(running, 10)

        asyncio.run(run())

    async def until(self, condition: Callable[[], object]) -> None:
        async with asyncio.timeout(10):
            while not condition():  # noqa: ASYNC110 - what it waits for knows no loop
                await asyncio.sleep(0.005)

    def count(self, kind: type) -> int:
        return sum(isinstance(item, kind) for _, item in self.engine.inputs)

    def has(self, kind: type) -> bool:
        return self.count(kind) > 0


class Pair:
    """A UDP link, and somebody who sends to it."""

    def __init__(self, opened: ExitStack) -> None:
        self.link = UdpLink(UdpUrl("udpin", HOST, 0))
        opened.callback(self.link.close)
        self.link.name = f"udpin:{self.link.fileno()}"
        self._sender = opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._sender.bind((HOST, 0))
        self.peer: Peer = self._sender.getsockname()
        with socket.socket(fileno=socket.dup(self.link.fileno())) as same:
            self._sender.connect(same.getsockname())

    def says(self, word: bytes) -> None:
        self._sender.send(word)


@pytest.fixture
def pairs() -> Iterator[list[Pair]]:
    with ExitStack() as opened:
        yield [Pair(opened) for _ in range(3)]


def test_a_machine_that_was_asleep_is_noticed_at_once_though_the_timer_is_far_off() -> None:
    bench = Bench(clients=[], vehicles=[])

    async def script() -> None:
        bench.engine.due = boot_time() + 0.5 * ASLEEP
        bench.runner._guarded(None)
        bench.engine.inputs.clear()
        bench.shift = ASLEEP
        began = boot_time()
        await bench.until(lambda: bench.has(NoneType))
        woken = next(now for now, item in bench.engine.inputs if item is None)
        assert woken - began == pytest.approx(ASLEEP, abs=1.0)
        bench.engine.due = inf

    bench.run(script)


def test_the_timer_comes_when_it_is_due_by_the_shifted_clock() -> None:
    bench = Bench(clients=[], vehicles=[])
    bench.shift = ASLEEP

    async def script() -> None:
        bench.engine.due = due = boot_time() + ASLEEP + 0.2
        bench.runner._guarded(None)
        bench.engine.inputs.clear()
        await bench.until(lambda: bench.has(NoneType))
        came = next(now for now, item in bench.engine.inputs if item is None)
        assert due <= came < due + 0.3
        bench.engine.due = inf

    bench.run(script)


def test_all_that_came_while_it_stood_still_is_handed_over_as_a_whole(pairs: list[Pair]) -> None:
    """Also what it does not read in one go, and with how long each piece had waited."""
    one, other, rover = pairs
    bench = Bench(clients=[one.link, other.link], vehicles=[rover.link])

    async def script() -> None:
        await asyncio.sleep(0.1)
        bench.engine.inputs.clear()
        for number in range(100):
            rover.says(bytes([number]))
        began = boot_time()
        other.says(b"continue")
        sleep(STOOD)  # noqa: ASYNC251 - the loop is to stand still
        one.says(b"stop")
        await bench.until(lambda: bench.has(AtOnce))
        (backlog,) = bench.engine.take(AtOnce)
        assert isinstance(backlog, AtOnce)
        assert not bench.has(Packets)
        by_link = {packets.link: packets for packets in backlog.packets}
        assert list(by_link)[-1] == rover.link.name  # clients first
        assert by_link[one.link.name].datagrams == [(one.peer, b"stop")]
        assert began + STOOD < by_link[one.link.name].arrived[0] < boot_time()
        assert by_link[other.link.name].datagrams == [(other.peer, b"continue")]
        assert began - 0.01 < by_link[other.link.name].arrived[0] < began + 0.1
        assert len(by_link[rover.link.name].datagrams) == 100
        one.says(b"now")
        await bench.until(lambda: bench.has(Packets))
        (packets,) = bench.engine.take(Packets)
        assert isinstance(packets, Packets)
        assert packets.datagrams == [(one.peer, b"now")]

    bench.run(script)


@pytest.mark.parametrize("step", [5.0, -5.0, 0.001, -0.001])
def test_a_clock_that_was_set_makes_nothing_newer(
    pairs: list[Pair], monkeypatch: pytest.MonkeyPatch, step: float
) -> None:
    one = pairs[0]
    bench = Bench(clients=[one.link], vehicles=[])
    wall, stepped = time.time, 0.0
    monkeypatch.setattr("mav_tasks.runner.time.time", lambda: wall() + stepped)

    async def script() -> None:
        nonlocal stepped
        for word in (b"before", b"after"):
            await asyncio.sleep(0.1)
            bench.engine.inputs.clear()
            said_at = boot_time()
            one.says(word)
            stepped += step
            await bench.until(lambda: bench.has(Packets))
            (packets,) = bench.engine.take(Packets)
            assert isinstance(packets, Packets)
            assert packets.arrived[0] <= said_at + 0.001
            step_is_over = word == b"after"
            if step_is_over:
                assert packets.arrived[0] > said_at - 0.2
            stepped -= step * step_is_over

    bench.run(script)


def test_what_stuck_at_the_sender_of_a_stream_is_as_old_as_what_was_here() -> None:
    stream = FakeStream()
    bench = Bench(clients=[stream], vehicles=[])

    async def script() -> None:
        await asyncio.sleep(0.1)
        stream.comes([PeerChange("peer", PeerState.UP)], b"on")
        bench.shift = ASLEEP
        await bench.until(lambda: bench.has(AtOnce))
        stream.comes([], b"and on")
        await bench.until(lambda: bench.has(Packets))
        await asyncio.sleep(0.6)
        stream.comes([], b"now")
        await bench.until(lambda: bench.count(Packets) == 2)
        (backlog,) = bench.engine.take(AtOnce)
        assert isinstance(backlog, AtOnce)
        late, fresh = bench.engine.take(Packets)
        assert isinstance(late, Packets)
        assert isinstance(fresh, Packets)
        for packets in (*backlog.packets, late):
            assert packets.arrived[0] == pytest.approx(boot_time(), abs=1.5)  # before it slept
        assert fresh.arrived[0] == pytest.approx(boot_time() + ASLEEP, abs=0.5)

    bench.run(script)


def test_what_several_clients_say_at_once_is_handed_over_as_a_whole_and_before_vehicles(
    pairs: list[Pair],
) -> None:
    one, other, rover = pairs
    bench = Bench(clients=[one.link, other.link], vehicles=[rover.link])

    async def script() -> None:
        await asyncio.sleep(0.12)
        for each, word in ((rover, b"beat"), (other, b"continue"), (one, b"stop")):
            each.says(word)
        await bench.until(lambda: bench.has(Packets))
        at_once, beat = bench.engine.take(AtOnce, Packets)
        assert isinstance(at_once, AtOnce)
        said = {packets.link: packets.datagrams[0][1] for packets in at_once.packets}
        assert said == {one.link.name: b"stop", other.link.name: b"continue"}
        assert beat == Packets(rover.link.name, [(rover.peer, b"beat")])
        arrived = {packets.link: packets.arrived[0] for packets in at_once.packets}
        assert arrived[other.link.name] < arrived[one.link.name]

    bench.run(script)
