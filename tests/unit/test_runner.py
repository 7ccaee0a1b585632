"""The shell between engine, store and links."""

import asyncio
import contextlib
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from time import monotonic

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    Committed,
    Congestion,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    PeerChanged,
    Shutdown,
    StoreFailed,
    WallClock,
)
from mav_tasks.links.base import PeerChange, PeerState
from mav_tasks.pump import Pump
from mav_tasks.runner import EXIT_FAILED, Runner
from mav_tasks.settings import Driving, Queueing, Settings
from mav_tasks.store import MemoryStore
from mav_tasks.store.opening import open_store
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.events import VehicleSeen
from mav_tasks.tasks.restored import Restored
from tests.kit.store import LateStore


class Recorder(Engine):
    """An engine that keeps what comes in."""

    def __init__(self) -> None:
        super().__init__(Settings(), now=0.0)
        self.inputs: list[object] = []

    def handle(self, item: object, *, now: float) -> None:
        self.inputs.append(item)


def send(outgoing: Outgoing) -> None:
    """Nobody is there."""


@pytest.mark.patches_core
def test_a_failing_store_is_told_to_the_engine_and_ends_nothing(
    caplog: pytest.LogCaptureFixture,
) -> None:
    engine, store = Recorder(), LateStore()
    pump = Pump(engine, store, send)
    with caplog.at_level(logging.INFO, "mav_tasks"):
        for _ in range(2):
            store.fail("store x: the disk is full")
            pump.turn(now=1.0)
        store.append([VehicleSeen(1, "found", 1.0)])
        pump.turn(now=2.0)
    assert engine.inputs == [StoreFailed("store x: the disk is full")] * 2 + [Committed(1)]
    assert [record.levelname for record in caplog.records] == ["ERROR", "ERROR", "WARNING"]
    assert not pump.is_over


class Failing:
    """An observer that fails in one of its methods."""

    def __init__(self, method: str) -> None:
        self._method = method
        self.told: list[str] = []

    def on_input(self, item: object, *, now: float) -> None:
        self._tell("on_input")

    def on_output(self, packets: object, events: object, *, now: float) -> None:
        self._tell("on_output")

    def close(self) -> None:
        self._tell("close")

    def _tell(self, method: str) -> None:
        self.told.append(method)
        if method == self._method:
            raise ValueError(method)


@pytest.mark.parametrize("method", ["on_input", "on_output", "close"])
def test_an_observer_that_fails_is_let_go_and_ends_nothing(
    method: str, caplog: pytest.LogCaptureFixture
) -> None:
    failing, other = Failing(method), Failing("never")
    pump = Pump(Engine(Settings(), now=0.0), MemoryStore(), send, observers=[failing, other])
    link = LinkChanged("clients", LinkSide.CLIENTS, up=True, peers=("somebody",))
    vehicles = LinkChanged("vehicles", LinkSide.VEHICLES, up=True, peers=("rover",))
    for now in (0.0, 1.0):
        pump.handle(link, now=now)
        pump.handle(vehicles, now=now)
        pump.handle_deadline(now=now)
        pump.turn(now=now)
    pump.close()
    assert failing.told.count(method) == 1
    assert other.told.count("on_input") == 6
    assert other.told.count("on_output") >= 2
    assert other.told[-1] == "close"
    assert [record.levelname for record in caplog.records] == ["ERROR"]


@pytest.mark.patches_core
def test_what_the_store_says_comes_in_at_once(tmp_path: Path) -> None:
    async def run() -> int:
        loop = asyncio.get_running_loop()
        engine = Recorder()
        store = SqliteStore(tmp_path / "s.sqlite3", wall_offset=lambda: 0.0)
        committed = asyncio.Event()

        def handle(item: object, *, now: float) -> None:
            if isinstance(item, Committed):
                committed.set()

        engine.handle = handle  # type: ignore[method-assign]
        engine.handle_deadline = lambda *, now: None  # type: ignore[method-assign]
        running = loop.create_task(Runner(engine, store, clients=[], vehicles=[]).run())
        await asyncio.sleep(0)
        store.append([VehicleSeen(1, "found", 1.0)])
        await asyncio.wait_for(committed.wait(), 10)
        for _ in range(2):  # the second leaves at once: this engine never ends in an orderly way
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.05)
        return await asyncio.wait_for(running, 10)

    assert threading.current_thread() is threading.main_thread()
    assert asyncio.run(run()) == 0
    with contextlib.closing(SqliteStore(tmp_path / "s.sqlite3", wall_offset=lambda: 0.0)) as store:
        assert store.load().ended_well


def test_where_the_store_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(open_store(":memory:"), MemoryStore)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    with contextlib.closing(open_store("")) as store:
        assert isinstance(store, SqliteStore)
        assert Path(store.name).is_relative_to(tmp_path.resolve())
        assert store.name.endswith("mav-tasks/mav-tasks.sqlite3")


class Flood:
    """A link from which much is read at once; its descriptor is readable as long as it is open."""

    name = "flood"
    peers: tuple[object, ...] = ()
    is_local = True
    is_stream = False
    note = ""

    def __init__(self, count: int) -> None:
        self.left = [(("127.0.0.1", 1), b"x")] * count
        self._read, self._write = os.pipe()
        os.write(self._write, b"!")

    def fileno(self) -> int:
        return self._read

    def receive(self, limit: int) -> list[tuple[tuple[str, int], bytes]]:
        taken, self.left = self.left[:limit], self.left[limit:]
        return taken

    def close(self) -> None:
        os.close(self._read)
        os.close(self._write)


@pytest.mark.patches_core
@pytest.mark.parametrize("is_due", [True, False])
def test_what_is_due_does_not_wait_for_all_that_came(is_due: bool) -> None:
    async def run() -> list[str]:
        loop = asyncio.get_running_loop()
        engine, seen, came = Engine(Settings(), now=loop.time()), list[str](), asyncio.Event()
        engine.take_events = engine.take_packets = list  # type: ignore[method-assign]

        def handle(item: object, *, now: float) -> None:
            if isinstance(item, Packets):
                seen.append(f"{len(item.datagrams)} in")
                time.sleep(len(item.datagrams) * 1e-3)  # what it is to find out
                came.set()

        def handle_deadline(*, now: float) -> None:
            seen.append("due")

        engine.handle = handle  # type: ignore[method-assign]
        engine.handle_deadline = handle_deadline  # type: ignore[method-assign]
        engine.next_deadline = lambda: loop.time() + (0.0 if is_due else 60.0)  # type: ignore[method-assign]
        runner = Runner(engine, MemoryStore(), clients=[], vehicles=[Flood(40)])  # type: ignore[list-item]
        running = loop.create_task(runner.run())
        await asyncio.wait_for(came.wait(), 10)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.02)
        await asyncio.wait_for(running, 10)
        return seen

    seen = asyncio.run(run())
    first = next(index for index, what in enumerate(seen) if "in" in what)
    if is_due:
        assert [what for what in seen if "in" in what][:3] == ["10 in", "6 in", "3 in"]
        came = [index for index, what in enumerate(seen) if "in" in what]
        assert {seen[index + 1] for index in came} == {"due"}
    else:
        assert seen[first] == "40 in"


class FakeStream:
    """A stream link that tells what it is given to tell."""

    name = "stream"
    peers: tuple[object, ...] = ()
    is_local = True
    is_stream = True
    note = ""

    def __init__(self) -> None:
        self.told: list[PeerChange] = []  # before anything is read
        self.read: list[tuple[list[PeerChange], bytes]] = []  # each with what reading shows
        self.tends = asyncio.Queue[None]()
        self.sent: list[bytes] = []
        self.firsts: list[bytes] = []
        self._read, self._write = os.pipe()

    def comes(self, changes: list[PeerChange], piece: bytes) -> None:
        self.read.append((changes, piece))
        os.write(self._write, b"!")

    def fileno(self) -> int:
        return self._read

    def receive(self, limit: int) -> list[tuple[object, bytes]]:
        os.read(self._read, 1)
        changes, piece = self.read.pop(0)
        self.told += changes
        return [("peer", piece)]

    def send(self, peer: object, data: bytes, *, first: bool = False) -> None:
        self.sent.append(data)
        self.firsts += [data] * first

    def take_changes(self) -> list[PeerChange]:
        told, self.told = self.told, []
        return told

    def poll(self) -> None:
        self.tends.put_nowait(None)

    def close(self) -> None:
        os.close(self._read)
        os.close(self._write)


@pytest.mark.patches_core
def test_the_engine_is_told_who_comes_before_its_words_and_who_goes_after_them(
    caplog: pytest.LogCaptureFixture,
) -> None:
    up = PeerChange("peer", PeerState.UP, "is up")
    down = PeerChange("peer", PeerState.DOWN, "lost: closed")

    async def run() -> list[object]:
        loop = asyncio.get_running_loop()
        engine, link = Recorder(), FakeStream()
        engine.handle_deadline = lambda *, now: None  # type: ignore[method-assign]
        running = loop.create_task(Runner(engine, MemoryStore(), clients=[link], vehicles=[]).run())
        await asyncio.sleep(0)
        link.comes([up, down], b"one")
        while not any(isinstance(item, Packets) for item in engine.inputs):
            await asyncio.wait_for(link.tends.get(), 10)
        link.told = [PeerChange("peer", PeerState.CONGESTED)]  # by a send, say: told when tended
        while link.told:
            await asyncio.wait_for(link.tends.get(), 10)
        link.told = [down, up]  # of before: in its order
        link.comes([PeerChange("peer", PeerState.CLEAR)], b"two")
        while engine.inputs[-1] != Congestion("stream", "peer", is_congested=False):
            await asyncio.wait_for(link.tends.get(), 10)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.02)
        await asyncio.wait_for(running, 10)
        return engine.inputs

    with caplog.at_level(logging.INFO, "mav_tasks"):
        inputs = asyncio.run(run())
    told = [item for item in inputs if not isinstance(item, WallClock | Shutdown)]
    assert [replace(each, arrived=()) if isinstance(each, Packets) else each for each in told] == [
        LinkChanged("stream", LinkSide.CLIENTS, up=True, is_stream=True),
        PeerChanged("stream", "peer", up=True),
        Packets("stream", [("peer", b"one")]),
        PeerChanged("stream", "peer", up=False),
        Congestion("stream", "peer", is_congested=True),
        PeerChanged("stream", "peer", up=False),
        PeerChanged("stream", "peer", up=True),
        Packets("stream", [("peer", b"two")]),
        Congestion("stream", "peer", is_congested=False),
    ]
    words = ["link stream is up", "link stream lost: closed"]
    words += ["link stream lost: closed", "link stream is up"]
    assert [record.getMessage() for record in caplog.records] == words


@pytest.mark.patches_core
def test_a_step_of_the_wall_clock_is_told_with_the_next_input_and_nothing_less_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps = [3600.0, 3600.3, -86_400.0]  # s; the second is below what is told
    stepped = 0.0
    monkeypatch.setattr("mav_tasks.runner.time.time", lambda: monotonic() + 1e9 + stepped)

    async def run() -> list[float]:
        nonlocal stepped
        engine, link = Recorder(), FakeStream()
        engine.handle_deadline = lambda *, now: None  # type: ignore[method-assign]
        loop = asyncio.get_running_loop()
        running = loop.create_task(Runner(engine, MemoryStore(), clients=[link], vehicles=[]).run())
        await asyncio.sleep(0)
        for number, step in enumerate(steps, 1):
            stepped = step
            link.comes([], b"word")
            while sum(isinstance(item, Packets) for item in engine.inputs) < number:
                await asyncio.wait_for(link.tends.get(), 10)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.02)
        await asyncio.wait_for(running, 10)
        return [item.offset for item in engine.inputs if isinstance(item, WallClock)]

    offsets = [offset - 1e9 for offset in asyncio.run(run())]
    assert offsets == pytest.approx([0.0, 3600.0, -86_400.0], abs=0.1)


@pytest.mark.patches_core
def test_who_goes_while_the_engine_is_told_of_others_is_gone_before_anybody_comes() -> None:
    """A packet that it sends then finds nobody there; the next one comes from the same place."""
    link = FakeStream()

    class Sending(Recorder):
        def handle(self, item: object, *, now: float) -> None:
            super().handle(item, now=now)
            if item == PeerChanged("stream", "other", up=False):
                link.told.append(PeerChange("peer", PeerState.DOWN))

    async def run() -> list[object]:
        engine = Sending()
        engine.handle_deadline = lambda *, now: None  # type: ignore[method-assign]
        loop = asyncio.get_running_loop()
        running = loop.create_task(Runner(engine, MemoryStore(), clients=[], vehicles=[link]).run())
        await asyncio.sleep(0)
        link.told = [PeerChange("other", PeerState.DOWN)]
        link.comes([PeerChange("peer", PeerState.UP)], b"again")
        while not any(isinstance(item, Packets) for item in engine.inputs):
            await asyncio.wait_for(link.tends.get(), 10)
        await asyncio.wait_for(link.tends.get(), 10)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.02)
        await asyncio.wait_for(running, 10)
        return engine.inputs

    changes = [item for item in asyncio.run(run()) if isinstance(item, PeerChanged)]
    assert [(change.peer, change.up) for change in changes] == [
        ("other", False),
        ("peer", False),
        ("peer", True),
    ]


class Slow(Recorder):
    """An engine whose packets are old when it gives them."""

    def handle_deadline(self, *, now: float) -> None:
        """Nothing is due."""

    def take_packets(self) -> list[Outgoing]:
        if not any(isinstance(item, Packets) for item in self.inputs):
            return []
        self.inputs.clear()
        old, now = (asyncio.get_running_loop().time() + wait for wait in (-1e-3, 60.0))
        packets = [
            Outgoing("stream", "peer", b"zero"),
            Outgoing("stream", "peer", b"on", until=old),
        ]
        return [*packets, Outgoing("stream", "peer", b"faster", until=now)]


@pytest.mark.patches_core
def test_what_was_made_before_the_process_stood_still_does_not_leave() -> None:
    link = FakeStream()

    async def run() -> None:
        engine = Slow()
        running = asyncio.create_task(
            Runner(engine, MemoryStore(), clients=[], vehicles=[link]).run()
        )
        await asyncio.sleep(0)
        link.comes([], b"word")
        while not link.sent:
            await asyncio.wait_for(link.tends.get(), 10)
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(0.02)
        await asyncio.wait_for(running, 10)

    asyncio.run(run())
    assert link.sent == [b"zero", b"faster"]


class Broken(Recorder):
    """An engine that fails when somebody comes, with a setpoint not yet sent."""

    def __init__(self) -> None:
        super().__init__()
        zero, hold = (Outgoing("stream", "peer", word) for word in (b"zero", b"hold"))
        self.emergency_stop_packets = (zero, hold._replace(is_first=True))

    def handle(self, item: object, *, now: float) -> None:
        super().handle(item, now=now)
        if isinstance(item, PeerChanged) and item.up:
            self._packets.append(Outgoing("stream", "peer", b"faster"))
            raise ZeroDivisionError

    def take_packets(self) -> list[Outgoing]:
        packets, self._packets = self._packets, []
        return packets

    def handle_deadline(self, *, now: float) -> None:
        self._packets.append(Outgoing("stream", "peer", b"on"))


def run_broken(link: FakeStream) -> int:
    async def run() -> int:
        runner = Runner(Broken(), MemoryStore(), clients=[], vehicles=[link])
        link.comes([PeerChange("peer", PeerState.UP), PeerChange("peer", PeerState.DOWN)], b"word")
        return await asyncio.wait_for(runner.run(), 10)

    return asyncio.run(run())


@pytest.mark.patches_core
def test_after_the_last_words_of_a_failed_engine_nothing_of_it_is_sent() -> None:
    link = FakeStream()
    assert run_broken(link) == EXIT_FAILED
    after = link.sent[link.sent.index(b"zero") :]
    assert after == [b"zero", b"hold"]
    assert link.firsts == [b"hold"]


@pytest.mark.patches_core
def test_the_last_words_of_a_failed_engine_do_not_wait_for_its_traceback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is made of source files, from a disk that may be slow."""
    link = FakeStream()
    sent_before: list[bytes] = []
    log = logging.getLogger("mav_tasks")
    monkeypatch.setattr(log, "critical", lambda *_, **__: sent_before.extend(link.sent))
    assert run_broken(link) == EXIT_FAILED
    assert sent_before[-2:] == [b"zero", b"hold"]


@pytest.mark.patches_core
def test_a_failed_engine_ends_the_server_even_if_its_last_words_fail_too() -> None:
    class Mute(FakeStream):
        def send(self, peer: object, data: bytes, *, first: bool = False) -> None:
            super().send(peer, data, first=first)
            if data == b"zero":
                raise ValueError

    link = Mute()
    assert run_broken(link) == EXIT_FAILED
    assert link.sent[-1] == b"hold"


class FakeReload:
    """Gives the same settings whenever they are asked for."""

    def __init__(self, settings: Settings, *, was_asked: bool) -> None:
        self.settings, self.was_asked = settings, was_asked
        self.begun = asyncio.Queue[Mapping[str, float]]()

    def begin(self, put: Callable[[Settings], Mapping[str, float]]) -> None:
        self.begun.put_nowait(put(self.settings))


@pytest.mark.parametrize("was_asked", [True, False])
def test_sighup_brings_new_settings_also_if_it_came_before(
    was_asked: bool, caplog: pytest.LogCaptureFixture
) -> None:
    kept = {"TSK_SPEED": 1.5, "TSK_QUOTA": 7.0}

    async def run() -> tuple[Mapping[str, float], Settings]:
        loop = asyncio.get_running_loop()
        engine = Engine(Settings(), now=loop.time(), restored=Restored(parameters=kept))
        slow = Settings(driving=Driving(speed=0.4, max_speed=1.0))
        reload = FakeReload(slow, was_asked=was_asked)
        runner = Runner(engine, MemoryStore(), clients=[], vehicles=[], reload=reload)
        runner._terminals = []  # whatever the tests are run in
        running = loop.create_task(runner.run())
        if not was_asked:
            await asyncio.sleep(0)
            os.kill(os.getpid(), signal.SIGHUP)
        parameters = await asyncio.wait_for(reload.begun.get(), 10)
        os.kill(os.getpid(), signal.SIGTERM)
        assert await asyncio.wait_for(running, 10) == 0
        return parameters, engine._settings

    with caplog.at_level(logging.INFO, "mav_tasks"):
        parameters, settings = asyncio.run(run())
    assert settings == Settings(
        driving=Driving(speed=0.4, max_speed=1.0), queueing=Queueing(quota=7)
    )
    assert parameters == {"TSK_QUOTA": 7.0}
    words = "parameter of an earlier run ignored: TSK_SPEED 1.5 is more than TSK_SPEED_MAX 1"
    assert words in [record.getMessage() for record in caplog.records]


@pytest.mark.patches_core
def test_a_terminal_that_is_gone_is_told_of_twice_and_ends_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the kernel and by the shell; a second order to stop would begin the stopping anew."""

    async def run() -> list[object]:
        engine, reload = Recorder(), FakeReload(Settings(), was_asked=False)
        engine.handle_deadline = lambda *, now: None  # type: ignore[method-assign]
        runner = Runner(engine, MemoryStore(), clients=[], vehicles=[], reload=reload)
        runner._terminals = [0]
        monkeypatch.setattr("mav_tasks.runner.HANGUP", 0.0)
        monkeypatch.setattr(os, "isatty", lambda _: False)
        running = asyncio.get_running_loop().create_task(runner.run())
        await asyncio.sleep(0)
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGHUP)
            await asyncio.sleep(0.02)
        os.kill(os.getpid(), signal.SIGTERM)
        assert await asyncio.wait_for(running, 10) == 0
        assert reload.begun.empty()
        return engine.inputs

    assert asyncio.run(run()).count(Shutdown()) == 1
