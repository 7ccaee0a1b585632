"""Keys as an operator has them: made, given to a server and its clients, and revoked."""

import io
import re
import socket
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from mav_tasks import Key, Move, NoAnswer, SyncClient
from tests.kit.cases import for_each
from tests.kit.commands import Done, called, mav_tasks
from tests.kit.processes import Stand, stand, wait_until
from tests.kit.terminal import Terminal, terminal
from tests.kit.web import key_in

PASSPHRASE = "correct horse battery staple"
REVOKED_WITHIN = 0.5  # s
COUNTED_BY_NOBODY = "no task server answered"


def keys(*arguments: str, ring: Path, given: str = "") -> Done:
    """Run ``mav-tasks keys``; ``given`` is its standard input, a pipe."""
    return mav_tasks("keys", *arguments, "--keys", str(ring), given=given, MAV_TASKS_CONFIG="")


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    """Where a key ring may be."""
    return tmp_path / "ring" / "keys.toml"


def test_a_key_is_made_shown_once_listed_and_revoked(ring: Path) -> None:
    made = keys("add", "anna", "--role", "operator", ring=ring)
    assert made.status == 0, made.error
    (secret,) = made.lines
    assert len(bytes.fromhex(secret)) == 32
    assert "not shown again" in made.error
    assert secret not in made.error
    assert stat.S_IMODE(ring.stat().st_mode) == 0o600

    given = keys(
        *("add", "qgc", "--role", "safety", "--passphrase"), ring=ring, given=f"{PASSPHRASE}\n"
    )
    assert (given.status, given.output) == (0, "")
    assert PASSPHRASE not in given.error
    assert PASSPHRASE not in ring.read_text(encoding="utf-8")

    listed = called("keys", "list", "--json", "--keys", str(ring))
    anna, qgc = listed.objects
    key = key_in(ring, "anna")
    assert (anna["file"], anna["fingerprint"], anna["usable"]) == (str(ring), key.fingerprint, True)
    assert (qgc["name"], qgc["role"], qgc["derivation"]) == ("qgc", "safety", "sha256")
    assert secret not in listed.output
    assert anna["limits"] == {}

    of_the_guide = "keys add agent --role submitter --max-distance 50 --max-speed 0.5 --quota 5"
    more = ("--max-priority", "5", "--tasks", "move,goto")
    given = keys(*of_the_guide.split()[1:], *more, ring=ring)
    assert given.status == 0, given.error
    limits = {"max_speed": 0.5, "max_distance": 50.0, "max_priority": 5, "quota": 5}
    (agent,) = called("keys", "list", "--json", "--keys", str(ring)).objects[2:]
    assert agent["limits"] == {"tasks": ["move", "goto"], **limits}

    shown = called("keys", "list", "--keys", str(ring))
    assert shown.lines[0] == f"key ring {ring}, 3 keys"
    assert shown.lines[1].split() == [
        "key",
        "role",
        "fingerprint",
        "derivation",
        "created",
        "revoked",
        "limits",
    ]
    assert secret not in shown.output

    assert called("keys", "revoke", "anna", "--keys", str(ring)).status == 0
    assert f'\nretired_secret = "{secret}"' in ring.read_text(encoding="utf-8")
    assert called("keys", "revoke", "anna", "--forget", "--keys", str(ring)).status == 0
    assert secret not in ring.read_text(encoding="utf-8")
    assert called("keys", "revoke", "anna", "--keys", str(ring)).status == 2
    again = called("keys", "list", "--json", "--keys", str(ring)).objects[0]
    assert (again["usable"], again["fingerprint"]) == (False, key.fingerprint)


@for_each(
    "how, secret",
    [
        ("sha256", "c4bbcb1fbec99d65bf59d85c8cb62ee2db963f0fe106f483d9afa73bd4e39a8a"),
        ("pbkdf2", "448de1bad133e15acae1271040b8af1fb11f8ce97bf018fe49696b1a1d4820c1"),
    ],
)
def test_a_passphrase_makes_the_key_of_a_ground_station(
    tmp_path: Path, how: str, secret: str
) -> None:
    """As ``openssl dgst`` and ``openssl kdf`` make it, with QGroundControl's salt and rounds."""
    ring = tmp_path / "keys.toml"
    options = ("--role", "safety", "--passphrase", "--derivation", how)
    assert keys("add", "qgc", *options, ring=ring, given=f"{PASSPHRASE}\n").status == 0
    assert key_in(ring, "qgc").secret.hex() == secret


MISTAKES = """add a --role boss => expected a role, one of observer
add a/b --role safety => is not a key name
add a --role safety --hex => expected 64 hexadecimal digits
add a --role safety --passphrase => at least 8 characters
add a --role safety --hex --generate => choose one of them
add a --role safety --derivation sha256 => and --passphrase
add a --role safety --max-speed 0 => max_speed: not in 0.05..100
add a --role vehicle --quota 1 => key of a rover has no limits
list => does not exist; mav-tasks keys add creates one
revoke a => does not exist"""


def test_a_mistake_is_one_clear_line(ring: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for arguments, words in re.findall("(.*) => (.*)", MISTAKES):
        monkeypatch.setattr(sys, "stdin", io.StringIO("geheim"))
        done = called("keys", *arguments.split(), "--keys", str(ring))
        assert (done.status, len(done.error.splitlines())) == (2, 1), done.error
        assert words in done.error
        assert "geheim" not in done.error
        assert not ring.exists()


class Signed:
    """A stand on which all is signed, and its ring."""

    def __init__(self, it: Stand, ring: Path) -> None:
        self.stand = it
        self.ring = ring
        self.url = f"udpout:127.0.0.1:{it.client_port}"

    def key(self, name: str) -> Key:
        """Return a key of the ring."""
        return key_in(self.ring, name)

    def cli(self, *arguments: str) -> Done:
        """Run a command that does not wait for long."""
        return called(*arguments, "--timeout", "1", server=self.url)


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Signed]:
    """A server that takes nothing unsigned from anybody, and a rover that signs."""
    folder = tmp_path_factory.mktemp("signed")
    ring = folder / "keys.toml"
    for name, role in (("r1", "vehicle"), ("anna", "operator"), ("ben", "safety")):
        assert called("keys", "add", name, "--role", role, "--keys", str(ring)).status == 0

    @contextmanager
    def signed_way(port: int) -> Iterator[str]:
        yield f"udpout:127.0.0.1:{port}?key=r1"

    with stand(
        folder,
        *("--keys", str(ring), "--record", str(folder / "records")),
        client_options="?unsigned=refuse",
        rover_options=("--sign", "r1", "--keys", str(ring)),
        way=signed_way,
    ) as it:
        yield Signed(it, ring)


def test_who_signs_drives_a_rover_that_signs(signed: Signed) -> None:
    with SyncClient(signed.url, key=signed.key("anna")) as client:
        assert client.submit(Move(0.3)).done(timeout=30).is_over
    assert abs(signed.stand.truth()[-1]["north"] - 0.3) < 0.1


def test_the_rover_hears_nothing_unsigned(signed: Signed) -> None:
    """What a server without its key says it does not answer: it is not even talked to."""
    heard = b""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(1.0)
        heartbeat = bytes.fromhex("fd090000fa01bf0000000f0000000a03d10403deb7")
        sock.sendto(heartbeat, ("127.0.0.1", signed.stand.rover_port))
        with suppress(TimeoutError):
            heard = sock.recv(300)
    assert heard == b""


def test_who_does_not_sign_is_told_that_this_may_be_why(signed: Signed) -> None:
    done = signed.cli("queue")
    assert done.status == 3
    assert COUNTED_BY_NOBODY in done.error
    assert "(if the server requires signatures, use --sign NAME)" in done.error
    with (
        pytest.raises(
            NoAnswer, match=r"no task server answered .* does the server have key stranger \("
        ),
        SyncClient(signed.url, key=Key("stranger", b"s" * 32), timeout=1.0),
    ):
        pass


def test_a_revoked_key_sends_nothing_any_more_within_half_a_second(signed: Signed) -> None:
    with (
        SyncClient(signed.url, key=signed.key("ben")) as ben,
        SyncClient(signed.url, key=signed.key("anna")) as anna,
    ):
        ben.queue()  # it is heard so far
        assert called("keys", "revoke", "ben", "--keys", str(signed.ring)).status == 0
        time.sleep(REVOKED_WITHIN)
        with pytest.raises(NoAnswer):  # sent again and again, ten times a second
            ben.stop(within=1.0)
        wait_until(
            lambda: "key ring: key ben was revoked" in signed.stand.server.text,
            within=1.0,
            what="the log",
        )
        assert anna.submit(Move(0.1)).done(timeout=30).is_over, "STOP was not obeyed"
        content = signed.ring.read_bytes()
        signed.ring.write_text("[keys.anna")
        signed.stand.server.wait_for("the keys in force stay")
        signed.ring.unlink()
        signed.stand.server.wait_for("was removed: the keys in force stay")
        assert anna.vehicles()[0].id == 1
        signed.ring.touch(0o600)
        signed.ring.write_bytes(content)


def test_a_key_is_in_force_as_soon_as_it_is_made(signed: Signed) -> None:
    added = called("keys", "add", "carl", "--role", "operator", "--keys", str(signed.ring))
    secret = bytes.fromhex(added.output.strip())
    time.sleep(REVOKED_WITHIN)
    with SyncClient(signed.url, key=secret, timeout=5) as client:
        assert client.vehicles()[0].id == 1


def test_no_secret_is_in_log_record_or_repr(signed: Signed) -> None:
    text = signed.ring.read_text(encoding="utf-8")
    secrets = set(map(bytes.fromhex, re.findall(r'^secret = "(.*)"', text, re.MULTILINE)))
    assert secrets
    folder = signed.ring.parent
    for path in folder.rglob("*"):
        if path.is_file() and path != signed.ring:
            data = path.read_bytes()
            assert not [s for s in secrets if s in data or s.hex().encode() in data], path


@contextmanager
def at_terminal(*arguments: str) -> Iterator[Terminal]:
    """Run a command at a terminal."""
    with terminal("-m", "mav_tasks.cli", *arguments) as shown:
        yield shown


def test_a_passphrase_is_asked_for_twice_and_not_shown(ring: Path) -> None:
    command = ("keys", "add", "qgc", "--role", "safety", "--passphrase", "--keys", str(ring))
    with at_terminal(*command) as shown:
        shown.wait_for(lambda text: "Passphrase:" in text)
        shown.type(f"{PASSPHRASE}\n".encode())
        shown.wait_for(lambda text: "Repeat it:" in text)
        shown.type(f"{PASSPHRASE}\n".encode())
        assert shown.end() == 0
        assert PASSPHRASE.encode() not in shown.written
    assert 'role = "safety"' in ring.read_text(encoding="utf-8")
