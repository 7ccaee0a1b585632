"""What a key ring holds, how it is written, and who may read it."""

import hashlib
import os
import stat
import threading
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest

from mav_tasks.errors import KeyRingError
from mav_tasks.key_ring import derivation
from mav_tasks.key_ring.ring import MOST_KEYS, Entry, KeyRing, key_of
from mav_tasks.key_ring.ring_file import change, load, path_of_ring
from mav_tasks.key_ring.toml_form import ring_of, text_of
from mav_tasks.mavlink.signing import Key
from mav_tasks.settings import Limits

AT = datetime(2026, 11, 21, 14, 30, tzinfo=UTC)
SECRET = bytes(range(32))
DIGITS = SECRET.hex()
ENTRY = f'[keys.anna]\nrole = "operator"\nsecret = "{DIGITS}"\n'


def entry(name: str = "anna", kind: str = "operator", secret: bytes = SECRET) -> Entry:
    return Entry(name, kind, key_of(name, kind, secret), "hex", AT)


def faults_of(text: str) -> tuple[str, ...]:
    with pytest.raises(KeyRingError) as caught:
        ring_of(text, name="k.toml")
    assert DIGITS not in str(caught.value)
    return caught.value.faults


# secrets


def test_a_passphrase_gives_what_ground_stations_make_of_it() -> None:
    words = "correct horse battery"
    assert derivation.from_passphrase(words, "sha256") == hashlib.sha256(words.encode()).digest()
    stretched = hashlib.pbkdf2_hmac(
        "sha256", words.encode(), b"QGroundControl-MAVLink-Signing-v1", 600_000
    )
    assert derivation.from_passphrase(words, "pbkdf2") == stretched


@pytest.mark.parametrize("how", derivation.PASSPHRASES)
def test_a_short_passphrase_is_refused_and_not_shown(how: str) -> None:
    with pytest.raises(KeyRingError, match=r"^a passphrase has at least 8 characters$"):
        derivation.from_passphrase("geheim1", how)


@pytest.mark.parametrize("text", ["", "00" * 31, "00" * 33, "zz" * 32, f" {DIGITS}"])
def test_what_is_not_64_digits_is_refused(text: str) -> None:
    with pytest.raises(KeyRingError, match=r"^expected 64 hexadecimal digits$"):
        derivation.from_hex(text)


def test_zeros_are_no_key() -> None:
    with pytest.raises(KeyRingError, match="all digits are zero"):
        derivation.from_hex("00" * 32)


def test_generated_secrets_differ() -> None:
    assert len({derivation.generated() for _ in range(10)}) == 10
    assert len(derivation.generated()) == 32


REVOKED = """[keys.anna]
role = "operator"
fingerprint = "0123456789abcdef"
revoked = 2026-11-21T14:30:00Z
"""

# the ring


def test_a_ring_is_read_as_it_was_written() -> None:
    ring = KeyRing().with_added(entry()).with_added(entry("rover-1", "vehicle", b"v" * 32))
    ring = ring.with_added(entry("old", "safety", b"o" * 32)).with_revoked("old", at=AT)
    again = ring_of(text_of(ring), name="k")
    assert again == ring
    assert [(key.name, key.role, bool(key.secret)) for key in again.keys] == [
        ("anna", "operator", True),
        ("rover-1", "", True),  # no client has rights by it
        ("old", "safety", False),
    ]


def test_limits_of_a_key_are_kept_and_told_to_the_engine() -> None:
    limits = Limits(("move", "wait"), max_priority=3, max_speed=0.5, max_distance=20.0, quota=2)
    limited = Entry("agent", "submitter", key_of("agent", "submitter", SECRET), limits=limits)
    ring = KeyRing().with_added(limited)
    assert 'tasks = ["move", "wait"]\nmax_priority = 3\nmax_speed = 0.5\n' in text_of(ring)
    again = ring_of(text_of(ring), name="k")
    assert (again, again.keys[0].limits) == (ring, limits)
    assert ring_of(text_of(again.with_revoked("agent", at=AT)), name="k").keys[0].limits == limits


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("max_speed = 0", "key anna: max_speed: not in 0.05..100 m/s"),
        ('tasks = ["fly"]', "key anna: tasks: 'fly': expected a list of move, rotate, drive"),
        ("quota = 1.5", "key anna: quota: not a whole number"),
        ("max_sped = 1", "key anna: only role, secret"),
    ],
)
def test_a_wrong_limit_is_refused_by_its_name(line: str, fault: str) -> None:
    (words,) = faults_of(f"{ENTRY}{line}\n")
    assert fault in words


def test_the_key_of_a_rover_has_no_limits() -> None:
    (words,) = faults_of(ENTRY.replace("operator", "vehicle") + "quota = 1\n")
    assert words.endswith("key anna: the key of a rover has no limits")


def test_the_secret_of_a_revoked_key_is_good_for_replays_alone() -> None:
    ring = ring_of(text_of(KeyRing().with_added(entry()).with_revoked("anna", at=AT)), name="k")
    assert f'\nretired_secret = "{DIGITS}"' in text_of(ring)
    assert f'\nsecret = "{DIGITS}"' not in text_of(ring)
    assert (ring.usable, [bool(key.secret) for key in ring.keys]) == ((), [False])
    assert ring.secrets == {ring.keys[0].fingerprint: entry().key.secret}
    assert DIGITS not in repr(ring)
    forgotten = ring.with_forgotten("anna")
    assert (forgotten.secrets, forgotten.keys) == ({}, ring.keys)
    assert DIGITS not in text_of(forgotten)
    with pytest.raises(KeyRingError, match="anna is in use: revoke it first"):
        KeyRing().with_added(entry()).with_forgotten("anna")


def test_a_revoked_key_cannot_come_back() -> None:
    ring = KeyRing().with_added(entry()).with_revoked("anna", at=AT)
    assert "revoked = 2026-11-21T14:30:00Z" in text_of(ring)
    assert ring.usable == ()
    assert len(ring.keys) == 1
    with pytest.raises(KeyRingError, match="anna was revoked on 2026-11-21: choose another name"):
        ring.with_added(entry(secret=b"n" * 32))
    with pytest.raises(KeyRingError, match="key ben: this secret was revoked, as key anna"):
        ring.with_added(entry("ben"))
    with pytest.raises(KeyRingError, match="key anna was revoked on 2026-11-21"):
        ring.with_revoked("anna", at=AT)


def test_names_and_secrets_are_unique() -> None:
    ring = KeyRing().with_added(entry())
    with pytest.raises(KeyRingError, match="key anna exists already: choose another name"):
        ring.with_added(entry(secret=b"n" * 32))
    with pytest.raises(KeyRingError, match="key ben: this secret exists already, as key anna"):
        ring.with_added(entry("ben"))


def test_there_are_no_more_keys_than_are_tried_on_a_packet() -> None:
    ring = KeyRing()
    for number in range(MOST_KEYS):
        ring = ring.with_added(entry(f"k{number}", secret=bytes([number + 1]) * 32))
    with pytest.raises(KeyRingError, match="key more: the key ring is full, 64 keys"):
        ring.with_added(entry("more", secret=b"\xff" * 32))
    ring.with_revoked("k0", at=AT).with_added(entry("more", secret=b"\xff" * 32))


@pytest.mark.parametrize("name", ["", "a b", "-a", "ä", "a" * 33, "a.b", "a\n"])
def test_a_name_can_be_said_anywhere(name: str) -> None:
    with pytest.raises(KeyRingError, match="is not a key name"):
        key_of(name, "operator", SECRET)


def test_an_unknown_key_is_answered_with_those_that_there_are() -> None:
    with pytest.raises(KeyRingError, match="no key 'ben' \\(usable keys: anna\\)"):
        KeyRing().with_added(entry()).usable_key("ben")


def test_no_repr_has_a_secret() -> None:
    ring = KeyRing().with_added(entry())
    for each in (ring, ring.entries[0], ring.keys[0]):
        assert DIGITS not in repr(each)
        assert str(SECRET) not in repr(each)


# the text


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("x = 1", "k.toml: expected only tables [keys.NAME]"),
        ("keys = 1", "k.toml: expected only tables [keys.NAME]"),
        ("keys.anna = 1", "k.toml:1: expected a table [keys.NAME]"),
        (
            '[keys.anna]\nrole = "boss"',
            (
                "k.toml:1: key anna: expected a role, one of "
                "observer, submitter, operator, safety, vehicle"
            ),
        ),
        (
            '[keys.anna]\nrole = "operator"',
            "k.toml:1: key anna: expected a secret, 64 hexadecimal digits in quotes",
        ),
        (
            '[keys.anna]\nrole = "operator"\nsecret = "12"',
            "k.toml:1: key anna: secret: expected 64 hexadecimal digits",
        ),
        (
            f"{ENTRY}colour = 1",
            (
                "k.toml:1: key anna: only "
                "role, secret, fingerprint, derivation, created, revoked, retired_secret"
            ),
        ),
        (
            f'{ENTRY}retired_secret = "{DIGITS}"',
            "k.toml:1: key anna: retired_secret: the key is not revoked",
        ),
        (
            f'{REVOKED}retired_secret = "{"0" * 64}"',
            "k.toml:1: key anna: retired_secret: all digits are zero",
        ),
        (
            f'{REVOKED}retired_secret = "{"1" * 64}"',
            "k.toml:1: key anna: retired_secret does not match fingerprint 0123456789abcdef",
        ),
        (
            f"{REVOKED}retired_secret = 3",
            "k.toml:1: key anna: retired_secret: expected 64 hexadecimal digits in quotes",
        ),
        (
            f"{ENTRY}revoked = 2026-11-21T14:30:00Z",
            "k.toml:1: key anna: it was revoked, but still has a secret: remove that",
        ),
        (
            f"{ENTRY}created = 3",
            "k.toml:1: key anna: created: expected a time such as 2026-11-21T14:30:00Z",
        ),
        (
            f'{ENTRY}derivation = "magic"',
            "k.toml:1: key anna: derivation: expected one of sha256, pbkdf2, hex, generated",
        ),
        (
            '[keys.anna]\nrole = "operator"\nrevoked = 2026-11-21T14:30:00Z',
            "k.toml:1: key anna: fingerprint: expected 16 hexadecimal digits",
        ),
        (
            '[keys.anna]\nrole = "operator"\npassphrase = "correct horse"',
            (
                "k.toml:1: key anna: the key ring has the derived key, not the passphrase: "
                "use mav-tasks keys add --passphrase"
            ),
        ),
        (
            f'{ENTRY}[keys.ben]\nrole = "safety"\nsecret = "{DIGITS}"',
            "k.toml:4: key ben: this secret exists already, as key anna",
        ),
        (f"{ENTRY}{ENTRY}", "k.toml:4: Cannot declare ('keys', 'anna') twice"),
        (f"[keys.{DIGITS}]", "k.toml:1: '…' is not a key name: "),
        (f"[keys.anna]\nrole = 'operator'\nsecret = {DIGITS}", "k.toml:3: "),
        (f"[{DIGITS}]\n[{DIGITS}]\n", "k.toml:2: Cannot declare ('…',) twice"),
    ],
)
def test_a_fault_names_key_and_line_but_no_secret(text: str, fault: str) -> None:
    assert faults_of(text)[0].startswith(fault)


def test_every_fault_is_told() -> None:
    faults = faults_of('[keys.a]\nrole = "x"\n[keys."b c"]\nrole = "safety"\n')
    assert [fault[:9] for fault in faults] == ["k.toml:1:", "k.toml:3:"]


# the file


def add(path: Path, which: Entry) -> None:
    change(path, lambda ring: ring.with_added(which))


def test_a_ring_is_its_users_alone_from_the_first_moment(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "keys.toml"
    umask = os.umask(0)
    try:
        add(path, entry())
    finally:
        os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert list(path.parent.iterdir()) == [path]
    assert load(path).ring.usable == (entry().key,)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o602, 0o644, 0o666])
def test_a_ring_that_others_can_get_at_is_refused(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "keys.toml"
    add(path, entry())
    path.chmod(mode)
    words = rf"other users can access it \(mode {mode:04o}\): chmod 600 {path}, and if they could"
    with pytest.raises(KeyRingError, match=words):
        load(path)
    with pytest.raises(KeyRingError, match="other users can access it"):
        add(path, entry("ben", secret=b"b" * 32))


def test_a_ring_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "keys.toml"
    add(path, entry())
    someone_else = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: someone_else)
    with pytest.raises(KeyRingError, match="belongs to another user"):
        load(path)


def test_what_is_no_file_is_told(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe", 0o600)
    for name, words in (("pipe", "not a file"), (".", "not a file"), ("x", "does not exist")):
        with pytest.raises(KeyRingError, match=words):
            load(tmp_path / name)
    (tmp_path / "large").write_bytes(b"#" * 300_000)
    (tmp_path / "large").chmod(0o600)
    with pytest.raises(KeyRingError, match="larger than 256 kB"):
        load(tmp_path / "large")


def test_a_change_that_is_refused_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "keys.toml"
    add(path, entry())
    before = path.read_bytes()
    with pytest.raises(KeyRingError, match="exists already"):
        add(path, entry())
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_of_many_who_add_at_once_each_is_in_the_ring(tmp_path: Path) -> None:
    path = tmp_path / "keys.toml"
    keys = [entry(f"k{number}", secret=bytes([number + 1]) * 32) for number in range(12)]
    threads = [threading.Thread(target=partial(add, path, each)) for each in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    assert {key.name for key in load(path).ring.usable} == {each.name for each in keys}


def test_a_link_to_a_ring_stays_one(tmp_path: Path) -> None:
    path, link = tmp_path / "keys.toml", tmp_path / "link.toml"
    add(path, entry())
    link.symlink_to(path)
    add(link, entry("ben", secret=b"b" * 32))
    assert link.is_symlink()
    assert len(load(path).ring.keys) == 2


def test_where_the_ring_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", "/home/anna")
    assert path_of_ring("") == tmp_path / "mav-tasks" / "keys.toml"
    assert path_of_ring("~/k.toml") == Path("/home/anna/k.toml")


def test_a_key_knows_itself_by_its_fingerprint() -> None:
    assert Key("a", SECRET).fingerprint == Key("b", SECRET).fingerprint
    assert Key("a", SECRET).fingerprint != Key("a", b"x" * 32).fingerprint
