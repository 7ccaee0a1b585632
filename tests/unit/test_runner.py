"""The shell between engine, store and links."""

import asyncio
import contextlib
import logging
import os
import signal
import threading
from pathlib import Path

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
from mav_tasks.runner import EXIT_FAILED, Pump, Runner
from mav_tasks.serve import open_store
from mav_tasks.settings import Settings
from mav_tasks.store import MemoryStore
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.events import VehicleSeen
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
    with contextlib.closing(open_store(None)) as store:
        assert isinstance(store, SqliteStore)
        assert Path(store.name).is_relative_to(tmp_path.resolve())
        assert store.name.endswith("mav-tasks/mav-tasks.sqlite3")


class Flood:
    """A link from which much is read at once; its descriptor is readable as long as it is open."""

    name = "flood"
    peers: tuple[object, ...] = ()
    is_local = True
    is_stream = False

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


@pytest.mark.parametrize("is_due", [True, False])
def test_what_is_due_does_not_wait_for_all_that_came(is_due: bool) -> None:
    async def run() -> list[str]:
        loop = asyncio.get_running_loop()
        engine, seen, came = Engine(Settings(), now=loop.time()), list[str](), asyncio.Event()
        engine.take_events = engine.take_packets = list  # type: ignore[method-assign]

        def handle(item: object, *, now: float) -> None:
            if isinstance(item, Packets):
                seen.append(f"{len(item.datagrams)} in")
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
        assert seen[first : first + 4] == ["8 in", "due", "8 in", "due"]
    else:
        assert seen[first] == "40 in"


class FakeStream:
    """A stream link that tells what it is given to tell."""

    name = "stream"
    peers: tuple[object, ...] = ()
    is_local = True
    is_stream = True

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

    def tend(self) -> None:
        self.tends.put_nowait(None)

    def close(self) -> None:
        os.close(self._read)
        os.close(self._write)


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
    assert [item for item in inputs if not isinstance(item, WallClock | Shutdown)] == [
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


class Broken(Recorder):
    """An engine that fails when somebody comes, with a setpoint not yet sent."""

    def __init__(self) -> None:
        super().__init__()
        zero, hold = (Outgoing("stream", "peer", word) for word in (b"zero", b"hold"))
        self.last_words = (zero, hold._replace(is_first=True))

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


def test_after_the_last_words_of_a_failed_engine_nothing_of_it_is_sent() -> None:
    link = FakeStream()
    assert run_broken(link) == EXIT_FAILED
    after = link.sent[link.sent.index(b"zero") :]
    assert after == [b"zero", b"hold"]
    assert link.firsts == [b"hold"]


def test_a_failed_engine_ends_the_server_even_if_its_last_words_fail_too() -> None:
    class Mute(FakeStream):
        def send(self, peer: object, data: bytes, *, first: bool = False) -> None:
            super().send(peer, data, first=first)
            if data == b"zero":
                raise ValueError

    link = Mute()
    assert run_broken(link) == EXIT_FAILED
    assert link.sent[-1] == b"hold"
