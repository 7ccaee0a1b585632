"""What a key ring may say, who may read its file, and how a change of it is told."""

import os
from pathlib import Path

import pytest

from mav_tasks.errors import KeyRingError
from mav_tasks.key_ring.derivation import from_passphrase
from mav_tasks.key_ring.ring_file import change, load, path_of_ring
from mav_tasks.key_ring.toml_form import ring_of, text_of
from mav_tasks.key_ring.watch import changes

KEY = '[keys.{}]\nrole = "operator"\nsecret = "{:064x}"\n'
ANNA, DIGITS = KEY.format("anna", 1), f"{1:064x}"
REVOKED = '[keys.anna]\nrole = "operator"\nrevoked = 2026-11-21T14:30:00Z\n'
OLD = f'{REVOKED}fingerprint = "0123456789abcdef"\n'
FAULTS = {
    f'{ANNA}passphrase = "correct horse"': "1: key anna: the key ring has the derived key, not",
    f"{ANNA}created = 3": "1: key anna: created: expected a time such as",
    f'{ANNA}retired_secret = "{DIGITS}"': "1: key anna: retired_secret: the key is not revoked",
    f"{OLD}retired_secret = 3": "1: key anna: retired_secret: expected 64 hexadecimal digits in",
    f'{OLD}retired_secret = "{"0" * 64}"': "1: key anna: retired_secret: all digits are zero",
    f'{OLD}retired_secret = "{DIGITS}"': "1: key anna: retired_secret does not match",
    REVOKED: "1: key anna: fingerprint: expected 16",
    f"[keys.{DIGITS}]": "1: '…' is not a key name: ",
    "".join(KEY.format(f"k{n}", n) for n in range(1, 66)): "193: key k65: the key ring is full, 64",
}


def test_a_fault_in_a_ring_names_key_and_line_and_no_secret() -> None:
    for text, words in FAULTS.items():
        with pytest.raises(KeyRingError) as caught:
            ring_of(text, name="k.toml")
        assert str(caught.value).startswith(f"k.toml:{words}"), caught.value
        assert DIGITS not in str(caught.value)


def test_a_ring_is_read_as_it_was_written_and_says_how_it_changed() -> None:
    before, after = (
        ring_of("".join(KEY.format(*each) for each in zip(names, secrets, strict=True)), name="k")
        for names, secrets in (("abc", (1, 2, 3)), ("abd", (9, 2, 4)))
    )
    assert ring_of(text_of(before), name="k") == before
    more = ring_of(f"{text_of(after)}\nquota = 2", name="k")
    assert list(changes((*before.keys, after.keys[2]), more.keys)) == [
        "key a has a new secret, role operator",
        "key c was removed",
        "key d has role operator (quota 2) now",
    ]
    assert list(changes((), after.keys[:1])) == ["key a was added, role operator"]
    with pytest.raises(KeyRingError, match="key a is in use: revoke it first"):
        before.with_forgotten("a")
    assert from_passphrase("correct horse", "pbkdf2") != from_passphrase("correct horse", "sha256")


def test_what_is_no_ring_of_ones_own_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring, loop = tmp_path / "keys.toml", tmp_path / "loop"
    change(ring, lambda ring: ring)
    loop.symlink_to(loop)
    for path, words in (
        (".", "not a file"),
        ("keys.toml/a", "Not a dir"),
        ("keys.toml", "another"),
    ):
        with pytest.raises(KeyRingError, match=words):
            load(tmp_path / path)
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    with pytest.raises(KeyRingError, match="loop: "):
        change(loop, lambda ring: ring)
    with pytest.raises(KeyRingError, match="~nobody-here/k: "):
        path_of_ring("~nobody-here/k")
