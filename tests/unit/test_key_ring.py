"""What a key ring may say, who may read its file, and how a change of it is told."""

import asyncio
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

from mav_tasks.errors import KeyRingError
from mav_tasks.key_ring.derivation import from_passphrase
from mav_tasks.key_ring.ring import MOST_KEYS, Entry, KeyRing, key_of
from mav_tasks.key_ring.ring_file import change, load, path_of_ring
from mav_tasks.key_ring.toml_form import ring_of, text_of
from mav_tasks.key_ring.watch import RingWatch, changes
from mav_tasks.settings import Limits

DIGITS = bytes(range(32)).hex()
ENTRY = f'[keys.anna]\nrole = "operator"\nsecret = "{DIGITS}"\n'
AT = datetime(2026, 11, 21, 14, 30, tzinfo=UTC)
REVOKED = '[keys.anna]\nrole = "operator"\nrevoked = 2026-11-21T14:30:00Z\n'
OLD = f'{REVOKED}fingerprint = "0123456789abcdef"\n'
FAULTS = {
    ENTRY + 'passphrase = "correct horse"': "key anna: the key ring has the derived key, not",
    ENTRY + "created = 3": "key anna: created: expected a time such as",
    ENTRY + f'retired_secret = "{DIGITS}"': "key anna: retired_secret: the key is not revoked",
    OLD + "retired_secret = 3": "key anna: retired_secret: expected 64 hexadecimal digits in",
    OLD + f'retired_secret = "{"0" * 64}"': "key anna: retired_secret: all digits are zero",
    OLD + f'retired_secret = "{DIGITS}"': "key anna: retired_secret does not match",
    REVOKED: "key anna: fingerprint: expected 16",
    f"[keys.{DIGITS}]": "'…' is not a key name: ",
}


def entry(number: int, name: str = "", limits: Limits | None = None) -> Entry:
    key = key_of(name or f"k{number}", "operator", bytes([number]) * 32)
    return Entry(key.name, "operator", key, limits=limits)


def test_a_fault_in_a_ring_names_key_and_line_and_no_secret() -> None:
    for text, words in FAULTS.items():
        with pytest.raises(KeyRingError) as caught:
            ring_of(text, name="k.toml")
        assert caught.value.faults[0].startswith(f"k.toml:1: {words}"), caught.value
        assert DIGITS not in str(caught.value)


def test_a_ring_is_read_as_it_was_written_and_says_how_it_changed() -> None:
    ring = KeyRing()
    for number in range(MOST_KEYS):
        ring = ring.with_added(entry(number + 1))
    with pytest.raises(KeyRingError, match="key k99: the key ring is full, 64 keys"):
        ring.with_added(entry(99))
    with pytest.raises(KeyRingError, match="k1 is in use: revoke it first"):
        ring.with_forgotten("k1")
    ring = ring.with_revoked("k1", at=AT)
    assert ring_of(text_of(ring), name="k") == ring
    new = KeyRing((entry(99, "k1"), entry(2, limits=Limits(quota=2)), entry(98), *ring.entries[3:]))
    assert list(changes(ring.keys, new.keys)) == [
        "key k1 has a new secret, role operator",
        "key k2 has role operator (quota 2) now",
        "key k3 was removed",
        "key k98 was added, role operator",
    ]
    stretched = from_passphrase("correct horse battery", "pbkdf2").hex()
    assert stretched != from_passphrase("correct horse battery", "sha256").hex()


def test_what_is_no_ring_of_ones_own_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring, loop = tmp_path / "keys.toml", tmp_path / "loop"
    change(ring, lambda ring: ring.with_added(entry(1)))
    loop.symlink_to(loop)
    for path, words in {".": "not a file", "keys.toml/a": "Not a directory"}.items():
        with pytest.raises(KeyRingError, match=words):
            load(tmp_path / path)
    with pytest.raises(KeyRingError, match="loop: "):
        change(loop, lambda ring: ring)
    with pytest.raises(KeyRingError, match="~nobody-here/k: "):
        path_of_ring("~nobody-here/k")
    user = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: user + 1)
    with pytest.raises(KeyRingError, match="belongs to another user"):
        load(ring)


def test_a_ring_that_cannot_be_read_changes_nothing_and_is_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, aside = tmp_path / "ring" / "keys.toml", tmp_path / "aside"
    change(path, lambda ring: ring.with_added(entry(1)))

    async def story() -> None:
        news: asyncio.Queue[tuple[object, ...]] = asyncio.Queue()
        watch = RingWatch(path, load(path))
        watch.begin(news.put_nowait)
        path.parent.rename(aside)
        await asyncio.sleep(0.35)
        path.parent.touch()
        await asyncio.sleep(0.15)
        path.parent.unlink()
        aside.rename(path.parent)
        change(path, lambda ring: ring.with_added(entry(2)))
        assert len(await asyncio.wait_for(news.get(), 5.0)) == 2
        watch.close()

    asyncio.run(story())
    told = [each.message for each in caplog.records]
    assert told == [
        f"key ring {path} was removed: the keys in force stay",
        f"key ring {path}: Not a directory: the keys in force stay",
        "key ring: key k2 was added, role operator",
    ]
