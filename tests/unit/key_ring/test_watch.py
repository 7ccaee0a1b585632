"""A key ring that changes while it is in use: at once, and never so that a door opens."""

import asyncio
import logging
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

from mav_tasks.key_ring.ring import Entry, key_of
from mav_tasks.key_ring.ring_file import change, load
from mav_tasks.key_ring.watch import RingWatch, changes
from mav_tasks.mavlink.signing import Key
from mav_tasks.settings import Limits

AT = datetime(2026, 11, 21, 14, 30, tzinfo=UTC)
WITHIN = 5.0  # s; it takes a tenth


class Watched:
    """A ring, watched; what it gives is waited for."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.news: asyncio.Queue[tuple[Key, ...]] = asyncio.Queue()
        self.watch = RingWatch(path, load(path) if path.exists() else None)
        self.watch.begin(self.news.put_nowait)

    async def names(self) -> dict[str, bool]:
        """The keys of the next change, and whether each is usable."""
        keys = await asyncio.wait_for(self.news.get(), WITHIN)
        return {key.name: bool(key.secret) for key in keys}


def add(path: Path, name: str) -> None:
    key = key_of(name, "operator", name.encode().ljust(32))
    change(path, lambda ring: ring.with_added(Entry(name, "operator", key, "hex", AT)))


def revoke(path: Path, name: str) -> None:
    change(path, lambda ring: ring.with_revoked(name, at=AT))


async def until_said(caplog: pytest.LogCaptureFixture, words: str) -> None:
    async with asyncio.timeout(WITHIN):
        while words not in caplog.text:  # noqa: ASYNC110  # a log tells nobody
            await asyncio.sleep(0.01)


def test_a_change_is_in_force_at_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "mav_tasks")
    path = tmp_path / "keys.toml"
    add(path, "anna")

    async def story() -> None:
        watched = Watched(path)
        began = asyncio.get_running_loop().time()
        add(path, "ben")
        assert await watched.names() == {"anna": True, "ben": True}
        revoke(path, "anna")
        assert await watched.names() == {"anna": False, "ben": True}
        assert asyncio.get_running_loop().time() - began < 2.0
        watched.watch.close()

    asyncio.run(story())
    assert [record.message for record in caplog.records] == [
        "key ring: key ben was added, role operator",
        "key ring: key anna was revoked",
    ]


def test_a_ring_may_appear_later(tmp_path: Path) -> None:
    async def story() -> None:
        watched = Watched(tmp_path / "keys.toml")
        assert watched.watch.keys is None
        add(watched.path, "anna")
        assert await watched.names() == {"anna": True}
        watched.watch.close()

    asyncio.run(story())


def test_a_ring_that_is_gone_or_broken_changes_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "keys.toml"
    add(path, "anna")

    async def story() -> None:
        watched = Watched(path)
        path.rename(tmp_path / "elsewhere")
        await until_said(caplog, f"key ring {path} was removed: the keys in force stay")
        path.write_text("[keys.anna")
        await until_said(caplog, "other users can access it")
        path.chmod(0o600)
        await until_said(caplog, f"{path}:1: ")
        assert watched.news.empty()
        assert [key.name for key in watched.watch.keys or ()] == ["anna"]
        (tmp_path / "elsewhere").rename(path)
        add(path, "ben")
        assert "ben" in await watched.names()
        watched.watch.close()

    asyncio.run(story())
    errors = [record.message for record in caplog.records if record.levelno == logging.ERROR]
    assert len(errors) == len(set(errors)), "each is told once"
    assert all("the keys in force stay" in each for each in errors)


def test_a_fault_is_told_once_for_as_long_as_it_lasts(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "keys.toml"
    add(path, "anna")

    async def story() -> None:
        watched = Watched(path)
        path.chmod(0o644)
        await until_said(caplog, "other users can access it")
        await asyncio.sleep(1.3)  # it is tried again each second
        path.chmod(0o600)
        add(path, "ben")
        assert "ben" in await watched.names()
        watched.watch.close()

    asyncio.run(story())
    assert caplog.text.count("other users can access it") == 1


def test_a_file_that_is_written_twice_within_a_tick_of_its_clock_is_read_twice(
    tmp_path: Path,
) -> None:
    path = tmp_path / "keys.toml"
    add(path, "anna")

    async def story() -> None:
        watched = Watched(path)
        data = path.read_bytes()
        path.write_bytes(data.replace(b"anna", b"ben1"))
        assert await watched.names() == {"ben1": True}
        # the same size, inode and times, as if the clock of the file system had not moved
        marks = load(path).mark
        path.write_bytes(data.replace(b"anna", b"carl"))
        os.utime(path, ns=(marks[2], marks[2]))
        assert await watched.names() == {"carl": True}
        watched.watch.close()

    asyncio.run(story())


def test_changes_are_told_by_the_names_of_keys() -> None:
    old = (Key("a", b"a" * 32, role="safety"), Key("b", b"b" * 32), Key("c", b"c" * 32))
    new = (
        Key("a", b"a" * 32, role="observer"),
        Key("b", b"B" * 32),
        Key("d", b"d" * 32, role="operator", limits=Limits(max_speed=0.5, quota=2)),
    )
    assert list(changes(old, new)) == [
        "key a has role observer now",
        "key b has a new secret, role vehicle",
        "key c was removed",
        "key d was added, role operator (max_speed 0.5 m/s, quota 2)",
    ]
    assert list(changes(old, old)) == []
