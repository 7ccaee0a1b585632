"""What a key ring may say, who may read its file, and how a change of it is told."""

import os
from pathlib import Path

import pytest

from mav_tasks.basics.errors import KeyRingError
from mav_tasks.config.key_ring.ring_file import change, load, path_of_ring
from mav_tasks.config.key_ring.toml_form import ring_of, text_of
from mav_tasks.config.key_ring.watch import changes

KEY = '[keys.{}]\nrole = "operator"\nsecret = "{:064x}"\n'
ANNA, DIGITS, ZERO = KEY.format("anna", 1), f"{1:064x}", "0" * 64
REVOKED = '[keys.anna]\nrole = "operator"\nrevoked = 2026-11-21T14:30:00Z\n'
OLD = f'{REVOKED}fingerprint = "0123456789abcdef"\n'
CHANGED = KEY.format("anna", 9) + KEY.format("c", 3)
RING = "".join(KEY.format(f"k{n}", n) for n in range(1, 66))
#: the text of a ring, with the texts above in it, and what is said
FAULTS = {
    '{ANNA}passphrase = "correct horse"': "1: key anna: the key ring has the derived key, not",
    "{ANNA}created = 3": "1: key anna: created: expected a time such as",
    '{ANNA}retired_secret = "{DIGITS}"': "1: key anna: retired_secret: the key is not revoked",
    "{OLD}retired_secret = 3": "1: key anna: retired_secret: expected 64 hexadecimal digits in",
    '{OLD}retired_secret = "{ZERO}"': "1: key anna: retired_secret: all digits are zero",
    '{OLD}retired_secret = "{DIGITS}"': "1: key anna: retired_secret does not match",
    "{REVOKED}": "1: key anna: fingerprint: expected 16",
    "[keys.{DIGITS}]": "1: '…' is not a key name: ",
    "{RING}": "193: key k65: the key ring is full, 64 keys",
}


def test_a_fault_in_a_ring_names_key_and_line_and_no_secret() -> None:
    for text, words in FAULTS.items():
        with pytest.raises(KeyRingError) as caught:
            ring_of(text.format_map(globals()), name="k.toml")
        assert str(caught.value).startswith(f"k.toml:{words}"), caught.value
        assert DIGITS not in str(caught.value)


def test_a_ring_is_read_as_it_was_written_and_says_how_it_changed() -> None:
    before, after = ring_of(ANNA + KEY.format("b", 2), name="k"), ring_of(CHANGED, name="k")
    assert ring_of(text_of(before), name="k") == before
    assert list(changes(before.keys, after.keys)) == [
        "key anna has a new secret, role operator",
        "key b was removed",
        "key c was added, role operator",
    ]
    with pytest.raises(KeyRingError, match="key anna is in use: revoke it first"):
        before.with_forgotten("anna")


def test_what_is_no_ring_of_ones_own_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change(tmp_path / "keys.toml", lambda ring: ring)
    for path, words in (
        (".", "not a file"),
        ("keys.toml/a", "Not a dir"),
        ("keys.toml", "another"),
    ):
        with pytest.raises(KeyRingError, match=words):
            load(tmp_path / path)
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    with pytest.raises(KeyRingError, match="~nobody-here/k: "):
        path_of_ring("~nobody-here/k")
