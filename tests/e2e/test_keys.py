"""Keys as an operator has them: made, given to a server and its clients, and revoked."""

import re
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from mav_tasks import Key, Move, NoAnswer, SyncClient
from mav_tasks.key_ring.ring_file import load
from tests.kit.commands import LIMIT, Done, called, mav_tasks, surroundings
from tests.kit.processes import STOP_LIMIT, Stand, free_udp_ports, process, stand, wait_until
from tests.kit.terminal import Terminal, terminal

PASSPHRASE = "correct horse battery staple"
REVOKED_WITHIN = 0.5  # s
COUNTED_BY_NOBODY = "no task server answered"


def keys(*arguments: str, ring: Path, given: str = "") -> Done:
    """Run ``mav-tasks keys``; ``given`` is its standard input, a pipe."""
    done = subprocess.run(
        [sys.executable, "-m", "mav_tasks.cli", "keys", *arguments, "--keys", str(ring)],
        input=given,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        env=surroundings("", MAV_TASKS_CONFIG=""),
        check=False,
    )
    return Done(done.returncode, done.stdout, done.stderr)


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
    key = load(ring).ring.usable_key("anna")
    assert (anna["file"], anna["fingerprint"], anna["usable"]) == (str(ring), key.fingerprint, True)
    assert (qgc["name"], qgc["role"], qgc["derivation"]) == ("qgc", "safety", "sha256")
    assert secret not in listed.output
    assert anna["limits"] == {}

    given = keys(
        *("add", "agent", "--role", "submitter", "--max-speed", "0.5", "--max-distance", "20"),
        *("--max-priority", "5", "--quota", "3", "--tasks", "move,goto"),
        ring=ring,
    )
    assert given.status == 0, given.error
    limits = {"max_speed": 0.5, "max_distance": 20.0, "max_priority": 5, "quota": 3}
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


def test_digits_of_another_end_are_taken_from_a_pipe(ring: Path) -> None:
    given = keys("add", "r1", "--role", "vehicle", "--hex", ring=ring, given="0f" * 32 + "\n")
    assert (given.status, given.output) == (0, "")
    assert load(ring).ring.usable == (Key("r1", b"\x0f" * 32),)


@pytest.mark.parametrize(
    ("arguments", "given", "words"),
    [
        (("add", "a", "--role", "boss"), "", "expected a role, one of observer"),
        (("add", "a b", "--role", "safety"), "", "is not a key name"),
        (("add", "a", "--role", "safety", "--hex"), "geheim", "expected 64 hexadecimal digits"),
        (("add", "a", "--role", "safety", "--passphrase"), "geheim", "at least 8 characters"),
        (("add", "a", "--role", "safety", "--hex", "--generate"), "", "choose one of them"),
        (("add", "a", "--role", "safety", "--derivation", "sha256"), "", "and --passphrase"),
        (("add", "a", "--role", "safety", "--max-speed", "0"), "", "max_speed: not in 0.05..100"),
        (("add", "a", "--role", "vehicle", "--quota", "1"), "", "key of a rover has no limits"),
        (("list",), "", "does not exist; mav-tasks keys add creates one"),
        (("revoke", "a"), "", "does not exist"),
    ],
)
def test_a_mistake_is_one_clear_line(
    arguments: tuple[str, ...],
    given: str,
    words: str,
    ring: Path,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    (tmp_path / "stdin").write_text(given, encoding="utf-8")
    with (tmp_path / "stdin").open(encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        done = called("keys", *arguments, "--keys", str(ring))
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
        return load(self.ring).ring.usable_key(name)

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


def test_it_is_said_what_is_asked(signed: Signed) -> None:
    said = signed.stand.server.text
    assert f"key ring {signed.ring}, 3 keys" in said
    assert f"clients on udpin:127.0.0.1:{signed.stand.client_port}, signed only\n" in said
    assert f"udpout:127.0.0.1:{signed.stand.rover_port}, signed only, key r1, waiting" in said


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


def test_commands_sign_by_name_one_right_after_the_other(signed: Signed) -> None:
    ring = ("--sign", "anna", "--keys", str(signed.ring))
    for _ in range(3):
        done = signed.cli("queue", "--json", *ring)
        assert done.status == 0, done.error
    missing = signed.cli("queue", "--sign", "carl", "--keys", str(signed.ring))
    assert (missing.status, missing.error) == (
        2,
        f"mav-tasks: --sign: no key 'carl' (usable keys: r1, anna, ben), in {signed.ring}\n",
    )
    assert "--keys needs --sign NAME" in signed.cli("queue", "--keys", "x").error


def test_the_environment_names_key_and_ring(
    signed: Signed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAV_TASKS_SIGN", "anna")
    monkeypatch.setenv("MAV_TASKS_SIGNING_KEYS", str(signed.ring))
    assert signed.cli("vehicles").status == 0


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


def test_a_key_is_in_force_as_soon_as_it_is_made(signed: Signed) -> None:
    added = called("keys", "add", "carl", "--role", "operator", "--keys", str(signed.ring))
    secret = bytes.fromhex(added.output.strip())
    time.sleep(REVOKED_WITHIN)
    with SyncClient(signed.url, key=secret, timeout=5) as client:
        assert client.vehicles()[0].id == 1


def test_no_secret_is_in_log_record_or_repr(signed: Signed) -> None:
    secrets = {key.secret for key in load(signed.ring).ring.usable}
    assert secrets
    folder = signed.ring.parent
    for path in folder.rglob("*"):
        if path.is_file() and path != signed.ring:
            data = path.read_bytes()
            assert not [s for s in secrets if s in data or s.hex().encode() in data], path


def test_a_record_is_replayed_also_after_its_keys_were_revoked(
    signed: Signed, tmp_path: Path
) -> None:
    (record,) = (signed.ring.parent / "records").iterdir()
    copy = tmp_path / "copy.mtlog"
    copy.write_bytes(record.read_bytes())

    def replayed() -> Done:
        return mav_tasks("replay", "--quiet", str(copy), XDG_CONFIG_HOME=str(tmp_path))

    without = replayed()
    assert without.status == 2
    assert (
        "its secret is missing; use --keys FILE with the key ring of that server" in without.error
    )
    own = tmp_path / "mav-tasks" / "keys.toml"  # the user's own, which need not be named
    own.parent.mkdir(mode=0o700)
    own.touch(mode=0o600)
    own.write_bytes(signed.ring.read_bytes())
    assert replayed().status == 0
    for key in load(own).ring.usable:
        assert called("keys", "revoke", key.name, "--keys", str(own)).status == 0
    assert load(own).ring.usable == ()
    after = replayed()
    assert after.status == 0, after
    assert called("keys", "revoke", "r1", "--forget", "--keys", str(own)).status == 0
    assert replayed().status == 2


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
    assert load(ring).ring.usable_key("qgc").role == "safety"


def test_who_signs_may_come_from_other_machines_without_a_further_word(
    ring: Path, tmp_path: Path
) -> None:
    (port,) = free_udp_ports(1)
    serve = ["-m", "mav_tasks.cli", "serve", "--no-push", "--client", f"udpin:0.0.0.0:{port}"]
    serve += ["--vehicle", "udpout:127.0.0.1:9", "--keys", str(ring)]
    for words in (
        "does not exist; mav-tasks keys add creates one",
        "other users can access it (mode 0644)",
    ):
        with process(*serve, folder=tmp_path, name="refused") as server:
            assert server.popen.wait(3 * STOP_LIMIT) == 2
            assert words in server.text
            assert len(server.text.splitlines()) == 1
        called("keys", "add", "anna", "--role", "operator", "--keys", str(ring))
        ring.chmod(0o644)
    ring.chmod(0o600)
    with process(*serve, folder=tmp_path, name="server") as server:
        server.wait_for(re.escape(f"clients on udpin:0.0.0.0:{port}, signed only\n"))
        server.end()
    assert server.popen.returncode == 0


def test_keys_that_are_added_and_revoked_at_once_are_all_kept(tmp_path: Path) -> None:
    """Twelve administrators at a time, each with a process of its own; then a revocation, too."""
    ring = tmp_path / "keys.toml"

    def at_once(*commands: tuple[str, ...]) -> None:
        with ExitStack() as running:
            all_of_them = [
                running.enter_context(
                    process(
                        *("-m", "mav_tasks.cli", "keys", *command, "--keys", str(ring)),
                        folder=tmp_path,
                        name="-".join(command[:2]),
                    )
                )
                for command in commands
            ]
            assert [each.popen.wait(30) for each in all_of_them] == [0] * len(commands)

    names = [f"user{number}" for number in range(12)]
    at_once(*(("add", name, "--role", "submitter") for name in names))
    assert sorted(key.name for key in load(ring).ring.usable) == sorted(names)
    more = [("add", f"later{number}", "--role", "observer") for number in range(3)]
    at_once(*more[:2], ("revoke", "user0"), more[2])
    usable = {key.name for key in load(ring).ring.usable}
    assert usable == {*names[1:], "later0", "later1", "later2"}
